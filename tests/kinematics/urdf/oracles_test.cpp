// SPDX-License-Identifier: Apache-2.0
//
// Others read what we write, by their own code, and must find the same robot: check_urdf, KDL (its
// tree is built here from urdfdom's model, as kdl_parser does it) and MuJoCo.
#include <cstdlib>
#include <fstream>
#include <memory>

#include <gtest/gtest.h>
#include <urdf_parser/urdf_parser.h>

#include "kinematics/urdf/urdf.h"
#include "tests/kinematics/model/random_tree.h"
#include "tests/truth/temporary_path.h"

#ifdef KINESCOPE_HAVE_KDL
#include <kdl/tree.hpp>
#include <kdl/treefksolverpos_recursive.hpp>
#endif
#ifdef KINESCOPE_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

namespace kinescope {
namespace {

// Both compute in double precision from the same decimal numbers; chains of ten joints of a metre.
// MuJoCo renormalises its quaternions to 1e-15 as well; 1e-9 (a nanometre) leaves room for its own
// order of sums.
constexpr double kOthersAgree = 1e-9;

std::filesystem::path write_temporary(const std::string& text, const std::string& name) {
  const std::filesystem::path path = truth::temporary_path(name);
  std::ofstream(path) << text;
  return path;
}

TEST(UrdfOracle, CheckUrdfTakesIt) {
  if (std::system("command -v check_urdf > /dev/null 2>&1") !=
      0) {  // NOLINT(concurrency-mt-unsafe)
    GTEST_SKIP() << "check_urdf (package liburdfdom-tools) is not installed";
  }
  Rng rng = Rng::from_name("UrdfOracle.CheckUrdfTakesIt");
  for (int robot = 0; robot < 5; ++robot) {
    const std::string text = write_urdf(random_tree(rng, 8, 4));
    const auto path = write_temporary(text, "check_urdf.urdf");
    const std::string command = "check_urdf '" + path.string() + "' > /dev/null 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << text;  // NOLINT(concurrency-mt-unsafe)
    std::filesystem::remove(path);
  }
}

#ifdef KINESCOPE_HAVE_KDL
KDL::Frame to_kdl(const urdf::Pose& pose) {
  const urdf::Rotation& q = pose.rotation;
  return {KDL::Rotation::Quaternion(q.x, q.y, q.z, q.w),
          KDL::Vector(pose.position.x, pose.position.y, pose.position.z)};
}

KDL::Joint to_kdl(const urdf::Joint& joint) {
  const KDL::Frame frame = to_kdl(joint.parent_to_joint_origin_transform);
  const KDL::Vector axis = frame.M * KDL::Vector(joint.axis.x, joint.axis.y, joint.axis.z);
  switch (joint.type) {
    case urdf::Joint::REVOLUTE:
    case urdf::Joint::CONTINUOUS:
      return KDL::Joint(joint.name, frame.p, axis, KDL::Joint::RotAxis);
    case urdf::Joint::PRISMATIC:
      return KDL::Joint(joint.name, frame.p, axis, KDL::Joint::TransAxis);
    default:
      return KDL::Joint(joint.name, KDL::Joint::None);
  }
}

void add_children(const urdf::Link& link, KDL::Tree& tree) {
  for (const auto& child : link.child_links) {
    const urdf::Joint& joint = *child->parent_joint;
    ASSERT_TRUE(tree.addSegment(
        KDL::Segment(child->name, to_kdl(joint), to_kdl(joint.parent_to_joint_origin_transform)),
        link.name));
    add_children(*child, tree);
  }
}

Pose from_kdl(const KDL::Frame& frame) {
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) T(r, c) = frame.M(r, c);
    T(r, 3) = frame.p(r);
  }
  return pose_from_matrix(T);
}

void compare_with_kdl(const KinematicTree& tree, Rng& rng) {
  const auto model = urdf::parseURDF(write_urdf(tree));
  ASSERT_NE(model, nullptr);
  KDL::Tree kdl(model->getRoot()->name);
  add_children(*model->getRoot(), kdl);
  if (kdl.getNrOfJoints() == 0) return;  // KDL's solver reads q(0) even then
  KDL::TreeFkSolverPos_recursive solver(kdl);
  for (int posture = 0; posture < 20; ++posture) {
    const Eigen::VectorXd values = random_values(rng, tree);
    KDL::JntArray q(kdl.getNrOfJoints());
    for (const auto& [name, element] : kdl.getSegments()) {
      const KDL::Joint& joint = element.segment.getJoint();
      if (joint.getType() == KDL::Joint::None) continue;
      q(element.q_nr) = values[tree.joint(joint.getName())->value];
    }
    const std::vector<Pose> ours = forward_kinematics(tree, values);
    KDL::Frame frame;
    for (std::size_t i = 0; i < tree.links.size(); ++i) {
      ASSERT_EQ(solver.JntToCart(q, frame, tree.links[i].name), 0);
      EXPECT_LT(pose_distance(from_kdl(frame), ours[i]), kOthersAgree) << tree.links[i].name;
    }
    for (const Marker& marker : tree.markers) {
      ASSERT_EQ(solver.JntToCart(q, frame, "tag_" + std::to_string(marker.id.value)), 0);
      EXPECT_LT(pose_distance(from_kdl(frame), ours[marker.link.index()] * marker.T_link_marker),
                kOthersAgree);
    }
  }
}

TEST(UrdfOracle, KdlFindsTheSameKinematics) {
  Rng rng = Rng::from_name("UrdfOracle.KdlFindsTheSameKinematics");
  for (int robot = 0; robot < 20; ++robot) {
    compare_with_kdl(random_tree(rng, 1 + rng.index(10), rng.index(5)), rng);
  }
}
#else
TEST(UrdfOracle, KdlFindsTheSameKinematics) {
  GTEST_SKIP() << "KDL (package liborocos-kdl-dev) was not installed when this was built";
}
#endif

#ifdef KINESCOPE_HAVE_MUJOCO
struct MujocoDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};

Pose body_pose(const mjModel& model, const mjData& data, const std::string& name) {
  const int body = mj_name2id(&model, mjOBJ_BODY, name.c_str());
  EXPECT_GE(body, 0) << name;
  if (body < 0) return {};
  const mjtNum* p = data.xpos + std::ptrdiff_t{3} * body;
  const mjtNum* q = data.xquat + std::ptrdiff_t{4} * body;
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), {p[0], p[1], p[2]}};
}

void compare_with_mujoco(const KinematicTree& tree, Rng& rng) {
  const auto path = write_temporary(write_urdf(tree), "mujoco.urdf");
  char error[1000] = "";
  const std::unique_ptr<mjModel, MujocoDeleter> model(
      mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  ASSERT_NE(model, nullptr) << error;
  std::filesystem::remove(path);
  const std::unique_ptr<mjData, MujocoDeleter> data(mj_makeData(model.get()));
  for (int posture = 0; posture < 20; ++posture) {
    const Eigen::VectorXd values = random_values(rng, tree);
    for (std::size_t j = 0; j < tree.joints.size(); ++j) {
      if (tree.joints[j].type == JointType::kFixed) continue;
      const int joint = mj_name2id(model.get(), mjOBJ_JOINT, tree.joints[j].name.c_str());
      ASSERT_GE(joint, 0);
      EXPECT_EQ(model->jnt_limited[joint] != 0, tree.joints[j].limits.has_value());
      data->qpos[model->jnt_qposadr[joint]] = values[static_cast<Eigen::Index>(j)];
    }
    mj_kinematics(model.get(), data.get());
    const std::vector<Pose> ours = forward_kinematics(tree, values);
    for (std::size_t i = 0; i < tree.links.size(); ++i) {
      EXPECT_LT(pose_distance(body_pose(*model, *data, tree.links[i].name), ours[i]), kOthersAgree);
    }
    for (const Marker& marker : tree.markers) {
      EXPECT_LT(pose_distance(body_pose(*model, *data, "tag_" + std::to_string(marker.id.value)),
                              ours[marker.link.index()] * marker.T_link_marker),
                kOthersAgree);
    }
  }
}

TEST(UrdfOracle, MujocoLoadsItAndFindsTheSameKinematics) {
  Rng rng = Rng::from_name("UrdfOracle.MujocoLoadsIt");
  for (int robot = 0; robot < 20; ++robot) {
    compare_with_mujoco(random_tree(rng, 1 + rng.index(10), rng.index(5)), rng);
  }
}
#else
TEST(UrdfOracle, MujocoLoadsItAndFindsTheSameKinematics) {
  GTEST_SKIP() << "MuJoCo (package libmujoco-dev) was not installed when this was built";
}
#endif

}  // namespace
}  // namespace kinescope
