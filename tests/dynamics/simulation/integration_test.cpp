// SPDX-License-Identifier: Apache-2.0
//
// Accelerations and motion of bodies without friction: MuJoCo's own, and conservation of energy.
#include <gtest/gtest.h>

#include "dynamics/experiments/reference_arms.h"
#include "dynamics/rigid/mass_matrix.h"
#include "dynamics/simulation/simulation.h"
#include "tests/kinematics/model/random_tree.h"
#include "tests/truth/random_dynamics.h"
#ifdef KINESCOPE_HAVE_MUJOCO
#include "tests/truth/mujoco_model.h"
#endif

namespace kinescope {
namespace {

DynamicModel without_friction(DynamicModel model) {
  for (JointDynamics& joint : model.joints) joint.viscous = joint.coulomb = 0.0;
  return model;
}

Plant plant_of(const DynamicModel& model) { return make_plant(with_effects(model)); }

#ifdef KINESCOPE_HAVE_MUJOCO
// Relative to the largest acceleration of the sample, times the condition of the mass matrix of ten
// bodies, which are up to three orders of magnitude apart.
constexpr double kOthersAgree = 1e-9;

Eigen::VectorXd mujoco_acceleration(const DynamicModel& model, const mjModel& theirs, mjData& data,
                                    const RandomStates& states, int row) {
  const std::vector<JointId> joints = moving_joints(model.tree);
  std::vector<int> place;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::string& name = model.tree.joints[joints[j].index()].name;
    const int joint = mj_name2id(&theirs, mjOBJ_JOINT, name.c_str());
    const auto i = static_cast<Eigen::Index>(j);
    place.push_back(theirs.jnt_dofadr[joint]);
    data.qpos[theirs.jnt_qposadr[joint]] = states.q(row, i);
    data.qvel[place.back()] = states.dq(row, i);
    data.qfrc_applied[place.back()] = states.ddq(row, i);
  }
  mj_forward(&theirs, &data);
  Eigen::VectorXd out(std::ssize(place));
  for (std::size_t j = 0; j < place.size(); ++j) {
    out[static_cast<Eigen::Index>(j)] = data.qacc[place[j]];
  }
  return out;
}

TEST(Simulation, MujocoFindsTheSameAccelerations) {
  Rng rng = Rng::from_name("Simulation.mujoco_finds_the_same_accelerations");
  int joints_seen = 0;
  for (int robot = 0; robot < 30; ++robot) {
    const DynamicModel model =
        without_friction(random_masses(random_tree(rng, 1 + rng.index(10), 0), {}, rng));
    if (moving_joints(model.tree).empty()) continue;
    joints_seen += static_cast<int>(moving_joints(model.tree).size());
    const MujocoModel theirs = to_mujoco(model);
    const MujocoData data(mj_makeData(theirs.get()));
    const RandomStates states = random_states(model.tree, 10, rng);
    const Plant plant = plant_of(model);
    for (int t = 0; t < 10; ++t) {
      Simulation simulation(
          plant, PlantState::at(plant, states.q.row(t).transpose(), states.dq.row(t).transpose()));
      // The random accelerations serve as torques.
      const Eigen::VectorXd ours = simulation.acceleration(states.ddq.row(t).transpose());
      const Eigen::VectorXd other = mujoco_acceleration(model, *theirs, *data, states, t);
      EXPECT_LT((ours - other).lpNorm<Eigen::Infinity>(),
                kOthersAgree * std::max(1.0, other.lpNorm<Eigen::Infinity>()))
          << "robot " << robot << " sample " << t;
    }
  }
  EXPECT_GT(joints_seen, 80);
}
#else
TEST(Simulation, MujocoFindsTheSameAccelerations) {
  GTEST_SKIP() << "MuJoCo (package libmujoco-dev) was not installed when this was built";
}
#endif

/// Largest change of the energy over 10 s of falling about, over the kinetic energy's own swing.
double energy_error(const DynamicModel& model, double step_s) {
  const Plant plant = plant_of(model);
  const Eigen::Index n = plant.size();
  Simulation simulation(
      plant, PlantState::at(plant, Eigen::VectorXd::Constant(n, 0.3), Eigen::VectorXd::Zero(n)));
  const auto energy = [&](const PlantState& state) {
    return kinetic_energy(plant.rigid, state.q, state.dq) + potential_energy(plant.rigid, state.q);
  };
  const double start = energy(simulation.state());
  double error = 0.0;
  double swing = 0.0;
  const Eigen::VectorXd no_torque = Eigen::VectorXd::Zero(n);
  const auto steps = static_cast<int>(10.0 / step_s);
  for (int k = 0; k < steps; ++k) {
    const PlantState& state = simulation.step(no_torque, step_s);
    if (k % 10 != 0) continue;
    error = std::max(error, std::abs(energy(state) - start));
    swing = std::max(swing, kinetic_energy(plant.rigid, state.q, state.dq));
  }
  return error / swing;
}

TEST(Simulation, EnergyIsKeptToSecondOrder) {
  // The Panda with stiff wrists, falling freely for 10 s: joints reach 20 rad/s.
  DynamicModel arm = without_friction(panda_arm());
  for (JointDynamics& joint : arm.joints) joint.motor_inertia = 0.1;
  const double coarse = energy_error(arm, 1e-3);
  const double fine = energy_error(arm, 2.5e-4);
  RecordProperty("energy_1ms", std::to_string(coarse));
  std::printf("energy over 10 s, relative: %.2e at 1 ms, %.2e at 0.25 ms\n", coarse, fine);
  EXPECT_LT(coarse, 1e-2);
  EXPECT_LT(fine, coarse / 8.0);  // 16 for a method of order 2
}

TEST(Simulation, APendulumSwingsWithItsPeriod) {
  // Closed form: small swings of a point mass on a rod of 1 m.
  DynamicModel model = dh_arm({{0.0, 0.0, 0.0}});
  for (InertialParameters& link : model.links) link = {};
  model.links[1] = from_central({.mass_kg = 1.0,
                                 .centre_m = Eigen::Vector3d(1.0, 0.0, 0.0),
                                 .inertia_kgm2 = Eigen::Matrix3d::Zero()});
  model.gravity_m_s2 = {9.81, 0.0, 0.0};
  const Plant plant = plant_of(model);
  constexpr double kSwing = 1e-3;
  Simulation simulation(
      plant, PlantState::at(plant, Eigen::VectorXd::Constant(1, kSwing), Eigen::VectorXd::Zero(1)));
  for (int k = 0; k < 10000; ++k) (void)simulation.step(Eigen::VectorXd::Zero(1), 1e-3);
  const double expected = kSwing * std::cos(std::sqrt(9.81) * 10.0);
  EXPECT_NEAR(simulation.state().q[0], expected, 1e-4 * kSwing);
}

}  // namespace
}  // namespace kinescope
