// SPDX-License-Identifier: Apache-2.0
//
// Others compute the same torques by their own code: KDL from its own tree, MuJoCo from our URDF.
#include <fstream>
#include <memory>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/kinematics/model/random_tree.h"
#include "tests/truth/random_dynamics.h"

#ifdef KINESCOPE_HAVE_KDL
#include <kdl/treeidsolver_recursive_newton_euler.hpp>

#include "tests/truth/kdl_tree.h"
#include "tests/truth/temporary_path.h"
#endif
#ifdef KINESCOPE_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

namespace kinescope {
namespace {

// Relative to the largest torque of the sample: double precision through ten bodies.
constexpr double kOthersAgree = 1e-9;

double relative_difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return (a - b).lpNorm<Eigen::Infinity>() / std::max(1.0, b.lpNorm<Eigen::Infinity>());
}

#ifdef KINESCOPE_HAVE_KDL
/// Our movable joints' places in KDL's arrays.
std::vector<unsigned> kdl_places(const KinematicTree& tree, const KDL::Tree& kdl) {
  std::vector<unsigned> places;
  for (const JointId id : moving_joints(tree)) {
    const Joint& joint = tree.joints[id.index()];
    places.push_back(kdl.getSegment(tree.links[joint.child.index()].name)->second.q_nr);
  }
  return places;
}

Eigen::VectorXd kdl_torque(const KDL::Tree& kdl, const std::vector<unsigned>& places,
                           const Eigen::Vector3d& gravity, const RandomStates& states, int row) {
  const auto n = static_cast<unsigned>(places.size());
  KDL::JntArray q(n);
  KDL::JntArray dq(n);
  KDL::JntArray ddq(n);
  KDL::JntArray torque(n);
  for (unsigned j = 0; j < n; ++j) {
    q(places[j]) = states.q(row, j);
    dq(places[j]) = states.dq(row, j);
    ddq(places[j]) = states.ddq(row, j);
  }
  KDL::TreeIdSolver_RNE solver(kdl, to_kdl(gravity));
  EXPECT_EQ(solver.CartToJnt(q, dq, ddq, {}, torque), 0);
  Eigen::VectorXd out(n);
  for (unsigned j = 0; j < n; ++j) out[j] = torque(places[j]);
  return out;
}

TEST(RigidOracle, KdlFindsTheSameTorques) {
  Rng rng = Rng::from_name("RigidOracle.KdlFindsTheSameTorques");
  int joints_seen = 0;
  for (int robot = 0; robot < 60; ++robot) {
    DynamicModel model =
        random_masses(random_tree(rng, 1 + rng.index(10), 0), {.motors = false}, rng);
    const KDL::Tree kdl = to_kdl(model);
    const std::vector<unsigned> places = kdl_places(model.tree, kdl);
    if (places.empty()) continue;
    joints_seen += static_cast<int>(places.size());
    const RandomStates states = random_states(model.tree, 20, rng);
    const Eigen::MatrixXd ours =
        inverse_dynamics_of_samples(make_rigid_model(model), states.q, states.dq, states.ddq);
    for (int t = 0; t < 20; ++t) {
      const Eigen::VectorXd theirs = kdl_torque(kdl, places, model.gravity_m_s2, states, t);
      EXPECT_LT(relative_difference(ours.row(t).transpose(), theirs), kOthersAgree)
          << "robot " << robot << " sample " << t;
    }
  }
  EXPECT_GT(joints_seen, 150);
}
#else
TEST(RigidOracle, KdlFindsTheSameTorques) {
  GTEST_SKIP() << "KDL (package liborocos-kdl-dev) was not installed when this was built";
}
#endif

#ifdef KINESCOPE_HAVE_MUJOCO
struct MujocoDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using MujocoModel = std::unique_ptr<mjModel, MujocoDeleter>;
using MujocoData = std::unique_ptr<mjData, MujocoDeleter>;

// MuJoCo finds the principal axes of an inertia by an iteration that stops at about this, relative.
constexpr double kMujocoAxes = 1e-5;

/// The link's inertia as MuJoCo read it from the URDF, which must be ours; then with exact
/// principal axes.
void refine_inertia(const InertialParameters& ours, mjModel& model, int body) {
  const CentralInertia central = to_central(ours);
  const auto at = [body](int size) { return std::ptrdiff_t{size} * body; };
  mjtNum* diagonal = model.body_inertia + at(3);
  mjtNum* q = model.body_iquat + at(4);
  const Eigen::Matrix3d R = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  const Eigen::Matrix3d theirs =
      R * Eigen::Vector3d(diagonal[0], diagonal[1], diagonal[2]).asDiagonal() * R.transpose();
  EXPECT_LT((theirs - central.inertia_kgm2).norm(), kMujocoAxes * central.inertia_kgm2.norm());
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(central.inertia_kgm2);
  Eigen::Matrix3d axes = eigen.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) *= -1.0;
  const Eigen::Quaterniond exact(axes);
  q[0] = exact.w();
  q[1] = exact.x();
  q[2] = exact.y();
  q[3] = exact.z();
  for (int k = 0; k < 3; ++k) diagonal[k] = eigen.eigenvalues()[k];
}

MujocoModel load(const DynamicModel& model) {
  const auto path = truth::temporary_path("rigid_oracle.urdf");
  std::ofstream(path) << write_urdf(model);
  char error[1000] = "";
  MujocoModel loaded(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  EXPECT_NE(loaded, nullptr) << error;
  std::filesystem::remove(path);
  if (loaded == nullptr) return loaded;
  const Eigen::Vector3d& g = model.gravity_m_s2;
  for (int k = 0; k < 3; ++k) loaded->opt.gravity[k] = g[k];
  loaded->opt.disableflags |= mjDSBL_CONTACT | mjDSBL_CONSTRAINT | mjDSBL_PASSIVE;
  for (std::size_t l = 1; l < model.links.size(); ++l) {
    const int body = mj_name2id(loaded.get(), mjOBJ_BODY, model.tree.links[l].name.c_str());
    refine_inertia(model.links[l], *loaded, body);
  }
  for (const JointId id : moving_joints(model.tree)) {
    const Joint& joint = model.tree.joints[id.index()];
    const int theirs = mj_name2id(loaded.get(), mjOBJ_JOINT, joint.name.c_str());
    const double armature = model.joints[id.index()].motor_inertia;
    loaded->dof_armature[loaded->jnt_dofadr[theirs]] = armature;
  }
  return loaded;
}

/// Torques of one sample, in our order.
Eigen::VectorXd mujoco_torque(const DynamicModel& model, const mjModel& theirs, mjData& data,
                              const RandomStates& states, int row) {
  const std::vector<JointId> joints = moving_joints(model.tree);
  Eigen::VectorXd out(static_cast<Eigen::Index>(joints.size()));
  std::vector<int> place;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::string& name = model.tree.joints[joints[j].index()].name;
    const int joint = mj_name2id(&theirs, mjOBJ_JOINT, name.c_str());
    const auto i = static_cast<Eigen::Index>(j);
    place.push_back(theirs.jnt_dofadr[joint]);
    data.qpos[theirs.jnt_qposadr[joint]] = states.q(row, i);
    data.qvel[place.back()] = states.dq(row, i);
    data.qacc[place.back()] = states.ddq(row, i);
  }
  mj_inverse(&theirs, &data);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    out[static_cast<Eigen::Index>(j)] = data.qfrc_inverse[place[j]];
  }
  return out;
}

TEST(RigidOracle, MujocoFindsTheSameTorques) {
  Rng rng = Rng::from_name("RigidOracle.MujocoFindsTheSameTorques");
  for (int robot = 0; robot < 30; ++robot) {
    const DynamicModel model = random_masses(random_tree(rng, 1 + rng.index(10), 0), {}, rng);
    if (moving_joints(model.tree).empty()) continue;
    const MujocoModel theirs = load(model);
    ASSERT_NE(theirs, nullptr);
    const MujocoData data(mj_makeData(theirs.get()));
    const RandomStates states = random_states(model.tree, 10, rng);
    const Eigen::MatrixXd ours =
        inverse_dynamics_of_samples(make_rigid_model(model), states.q, states.dq, states.ddq);
    for (int t = 0; t < 10; ++t) {
      const Eigen::VectorXd torque = mujoco_torque(model, *theirs, *data, states, t);
      EXPECT_LT(relative_difference(ours.row(t).transpose(), torque), kOthersAgree)
          << "robot " << robot << " sample " << t;
    }
  }
}
#else
TEST(RigidOracle, MujocoFindsTheSameTorques) {
  GTEST_SKIP() << "MuJoCo (package libmujoco-dev) was not installed when this was built";
}
#endif

}  // namespace
}  // namespace kinescope
