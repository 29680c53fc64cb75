// SPDX-License-Identifier: Apache-2.0
//
// Others compute the same torques by their own code: KDL from its own tree, MuJoCo from our URDF.
#include <gtest/gtest.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"
#include "tests/kinematics/model/random_tree.h"
#include "tests/truth/random_dynamics.h"

#ifdef KINESCOPE_HAVE_KDL
#include <kdl/treeidsolver_recursive_newton_euler.hpp>

#include "tests/truth/kdl_tree.h"
#endif
#ifdef KINESCOPE_HAVE_MUJOCO
#include "tests/truth/mujoco_model.h"
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
    const MujocoModel theirs = to_mujoco(model);
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
