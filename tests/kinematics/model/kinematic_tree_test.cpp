// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/kinematic_tree.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/kinematics/model/random_tree.h"

namespace kinescope {
namespace {

constexpr double kExact = 1e-12;  // some tens of products of numbers up to 10
// Central differences, step 1e-6: second-order error 1e-12 over rounding 1e-15 / 1e-6.
constexpr double kStep = 1e-6;
constexpr double kDifference = 1e-8;

Joint make_joint(JointType type, int parent, int child, const Eigen::Vector3d& place,
                 const Eigen::Vector3d& axis) {
  Joint joint;
  joint.name = "joint" + std::to_string(child);
  joint.type = type;
  joint.parent = LinkId{parent};
  joint.child = LinkId{child};
  joint.T_parent_joint.translation = place;
  joint.axis = axis;
  return joint;
}

/// SCARA: two turns about z with arms of 0.4 and 0.3 m, then a slide down.
KinematicTree scara() {
  KinematicTree tree;
  tree.links = {{"base"}, {"upper"}, {"fore"}, {"quill"}};
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  tree.joints = {make_joint(JointType::kRevolute, 0, 1, {0, 0, 0.5}, z),
                 make_joint(JointType::kRevolute, 1, 2, {0.4, 0, 0}, z),
                 make_joint(JointType::kPrismatic, 2, 3, {0.3, 0, 0}, -z)};
  tree.markers = {{.id = TagId{5}, .link = LinkId{3}, .T_link_marker = {}, .size_m = 0.05}};
  return tree;
}

TEST(ForwardKinematics, OfAScaraInClosedForm) {
  const KinematicTree tree = scara();
  Rng rng = Rng::from_name("ForwardKinematics.Scara");
  for (int i = 0; i < 100; ++i) {
    const double a = rng.uniform(-3, 3);
    const double b = rng.uniform(-3, 3);
    const double d = rng.uniform(0, 0.2);
    const Pose tip = forward_kinematics(tree, Eigen::Vector3d(a, b, d))[3];
    const Eigen::Vector3d expected(0.4 * std::cos(a) + 0.3 * std::cos(a + b),
                                   0.4 * std::sin(a) + 0.3 * std::sin(a + b), 0.5 - d);
    EXPECT_LT((tip.translation - expected).norm(), kExact);
    EXPECT_LT(angle_between(tip.rotation, exp_rotation({0, 0, a + b})), kExact);
  }
}

TEST(ForwardKinematics, OfABranchDoesNotMoveTheOther) {
  KinematicTree tree = scara();
  tree.links.push_back({"second arm"});
  tree.joints.push_back(
      make_joint(JointType::kRevolute, 0, 4, {0, 1, 0}, Eigen::Vector3d::UnitX()));
  Eigen::VectorXd values = Eigen::VectorXd::Zero(4);
  values[3] = 1.0;
  const std::vector<Pose> poses = forward_kinematics(tree, values);
  EXPECT_LT((poses[3].translation - Eigen::Vector3d(0.7, 0, 0.5)).norm(), kExact);
  EXPECT_LT(angle_between(poses[4].rotation, exp_rotation({1, 0, 0})), kExact);
}

TEST(ForwardKinematics, IgnoresTheValueOfAFixedJoint) {
  KinematicTree tree = scara();
  tree.joints[1].type = JointType::kFixed;
  EXPECT_EQ(pose_distance(forward_kinematics(tree, Eigen::Vector3d(0.3, 7.0, 0.1))[3],
                          forward_kinematics(tree, Eigen::Vector3d(0.3, 0.0, 0.1))[3]),
            0.0);
}

TEST(BodyJacobian, AgainstDifferences) {
  Rng rng = Rng::from_name("BodyJacobian.AgainstDifferences");
  for (int robot = 0; robot < 30; ++robot) {
    const KinematicTree tree = random_tree(rng, 6, 0);
    const Eigen::VectorXd q = random_values(rng, tree);
    for (int l = 0; l < static_cast<int>(tree.links.size()); ++l) {
      const auto jacobian = body_jacobian(tree, q, LinkId{l});
      const Pose here = forward_kinematics(tree, q)[static_cast<std::size_t>(l)];
      for (Eigen::Index j = 0; j < q.size(); ++j) {
        Eigen::VectorXd ahead = q;
        Eigen::VectorXd behind = q;
        ahead[j] += kStep;
        behind[j] -= kStep;
        const auto at = [&](const Eigen::VectorXd& values) {
          return log_pose(here.inverse() *
                          forward_kinematics(tree, values)[static_cast<std::size_t>(l)]);
        };
        EXPECT_LT(((at(ahead) - at(behind)) / (2.0 * kStep) - jacobian.col(j)).norm(), kDifference);
      }
    }
  }
}

TEST(Tree, Lookups) {
  const KinematicTree tree = scara();
  EXPECT_EQ(tree.link("fore"), LinkId{2});
  EXPECT_EQ(tree.link("none"), std::nullopt);
  EXPECT_EQ(tree.joint("joint2"), JointId{1});
  EXPECT_EQ(tree.marker(TagId{5})->link, LinkId{3});
  EXPECT_EQ(tree.marker(TagId{6}), nullptr);
  EXPECT_EQ(tree.parent_joint(LinkId{0}), std::nullopt);
  EXPECT_EQ(tree.path_to(LinkId{3}), (std::vector<JointId>{{0}, {1}, {2}}));
  EXPECT_TRUE(tree.path_to(LinkId{0}).empty());
}

TEST(CheckTree, RefusesWhatIsNone) {
  const auto refused = [](auto damage) {
    KinematicTree tree = scara();
    damage(tree);
    EXPECT_THROW(check_tree(tree), std::logic_error);
  };
  check_tree(scara());
  refused([](KinematicTree& t) { t.links.clear(); });
  refused([](KinematicTree& t) { t.links.push_back({"loose"}); });
  refused([](KinematicTree& t) { std::swap(t.joints[0], t.joints[2]); });
  refused([](KinematicTree& t) { t.joints[2].child = LinkId{1}; });
  refused([](KinematicTree& t) { t.joints[2].child = LinkId{9}; });
  refused([](KinematicTree& t) { t.joints[0].axis *= 2.0; });
  refused([](KinematicTree& t) { t.joints[0].axis.x() = std::nan(""); });
  refused([](KinematicTree& t) { t.links[2].name = "base"; });
  refused([](KinematicTree& t) { t.joints[2].name = "joint1"; });
  refused([](KinematicTree& t) { t.markers[0].link = LinkId{7}; });
}

}  // namespace
}  // namespace kinescope
