// SPDX-License-Identifier: Apache-2.0
//
// Friction at rest and about it.
#include <gtest/gtest.h>

#include "dynamics/experiments/reference_arms.h"
#include "dynamics/simulation/simulation.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kCoulomb = 2.0;

/// One joint about a level axis with 1 kg m^2 and no weight.
DynamicModel flywheel() {
  DynamicModel model = dh_arm({{0.0, 0.0, 0.0}});
  model.gravity_m_s2.setZero();
  model.links[1] = from_central({.mass_kg = 1.0,
                                 .centre_m = Eigen::Vector3d::Zero(),
                                 .inertia_kgm2 = Eigen::Matrix3d::Identity()});
  return model;
}

TorqueEffect effect(const std::string& name, const std::string& place, double scan,
                    std::vector<double> values) {
  TorqueEffect out;
  out.id = {name, place};
  out.scan = scan;
  out.values = Eigen::Map<Eigen::VectorXd>(values.data(), std::ssize(values));
  return out;
}

Eigen::VectorXd one(double value) { return Eigen::VectorXd::Constant(1, value); }

Simulation at_rest(const std::vector<TorqueEffect>& effects) {
  const Plant plant = make_plant(with_effects(flywheel(), effects));
  return {plant, PlantState::at(plant, one(0.5), one(0.0))};
}

TEST(Sticking, HoldsExactlyUpToBreakaway) {
  const std::string joint = flywheel().tree.joints[0].name;
  Simulation simulation =
      at_rest({effect("coulomb", joint, 0.0, {kCoulomb}), effect("stribeck", joint, 0.1, {1.0})});
  for (int k = 0; k < 1000; ++k) (void)simulation.step(one(2.999), 1e-3);
  EXPECT_EQ(simulation.state().q[0], 0.5);
  EXPECT_EQ(simulation.acceleration(one(2.999))[0], 0.0);
  EXPECT_NEAR(simulation.acceleration(one(3.5))[0], 0.5, 1e-12);
  for (int k = 0; k < 1000; ++k) (void)simulation.step(one(3.001), 1e-3);
  EXPECT_GT(simulation.state().q[0], 0.5 + 1e-4);
}

TEST(Sticking, SlidesToAStopWhereTheEquationSays) {
  const std::string joint = flywheel().tree.joints[0].name;
  const Plant plant =
      make_plant(with_effects(flywheel(), {effect("coulomb", joint, 0.0, {kCoulomb})}));
  Simulation simulation(plant, PlantState::at(plant, one(0.0), one(1.0)));
  for (int k = 0; k < 1000; ++k) (void)simulation.step(one(0.0), 1e-3);
  EXPECT_NEAR(simulation.state().q[0], 1.0 / (2.0 * kCoulomb), 1e-9);  // v^2 / (2 a)
  EXPECT_EQ(simulation.state().dq[0], 0.0);
}

TEST(Sticking, ViscousFrictionDecaysExponentially) {
  const std::string joint = flywheel().tree.joints[0].name;
  const Plant plant = make_plant(with_effects(flywheel(), {effect("viscous", joint, 0.0, {3.0})}));
  Simulation simulation(plant, PlantState::at(plant, one(0.0), one(1.0)));
  for (int k = 0; k < 1000; ++k) (void)simulation.step(one(0.0), 1e-3);
  EXPECT_NEAR(simulation.state().dq[0], std::exp(-3.0), 1e-6);
}

TEST(Sticking, PreslidingSpringsBack) {
  // Below Dahl's friction the joint is a spring of friction / length.
  const std::string joint = flywheel().tree.joints[0].name;
  constexpr double kLength = 1e-2;
  Simulation simulation = at_rest(
      {effect("hysteresis", joint, kLength, {kCoulomb}), effect("viscous", joint, 0.0, {20.0})});
  constexpr double kPush = 0.01;
  for (int k = 0; k < 5000; ++k) (void)simulation.step(one(kPush), 1e-3);
  EXPECT_NEAR(simulation.state().q[0] - 0.5, kPush * kLength / kCoulomb, 2e-7);
}

TEST(Sticking, SmoothFrictionCreepsByItsWidth) {
  const std::string joint = flywheel().tree.joints[0].name;
  CorrectedTorqueModel model =
      with_effects(flywheel(), {effect("coulomb", joint, 0.0, {kCoulomb})});
  model.base.widths[0] = 0.01;
  const Plant plant = make_plant(model);
  Simulation creeping(plant, PlantState::at(plant, one(0.0), one(0.0)));
  for (int k = 0; k < 2000; ++k) (void)creeping.step(one(0.5 * kCoulomb), 1e-3);
  EXPECT_NEAR(creeping.state().dq[0], 0.01 * std::atanh(0.5), 1e-9);
  Simulation held(sticking(plant), PlantState::at(plant, one(0.0), one(0.0)));
  for (int k = 0; k < 2000; ++k) (void)held.step(one(0.5 * kCoulomb), 1e-3);
  EXPECT_EQ(held.state().q[0], 0.0);
}

TEST(Sticking, AnArmUnderItsWeightRestsWhereFrictionHoldsIt) {
  DynamicModel arm = panda_arm();
  for (const JointId id : moving_joints(arm.tree)) arm.joints[id.index()].coulomb = 200.0;
  const Plant plant = make_plant(with_effects(arm));
  const Eigen::VectorXd q = Eigen::VectorXd::Constant(7, 0.4);
  Simulation simulation(plant, PlantState::at(plant, q, Eigen::VectorXd::Constant(7, 0.1)));
  for (int k = 0; k < 500; ++k) (void)simulation.step(Eigen::VectorXd::Zero(7), 1e-3);
  const Eigen::VectorXd stopped = simulation.state().q;
  for (int k = 0; k < 500; ++k) (void)simulation.step(Eigen::VectorXd::Zero(7), 1e-3);
  EXPECT_EQ(simulation.state().q, stopped);
  EXPECT_GT((stopped - q).norm(), 0.0);
}

TEST(Sticking, RefusesEffectsOfAnotherRobot) {
  const auto assemble = [](const TorqueEffect& e) {
    (void)make_plant(with_effects(flywheel(), {e}));
  };
  const std::string joint = flywheel().tree.joints[0].name;
  EXPECT_THROW(assemble(effect("coulomb", "elbow", 0.0, {1.0})), Error);
  EXPECT_THROW(assemble(effect("coulomb", joint, 0.0, {1.0, 2.0})), Error);
  EXPECT_THROW(assemble(effect("stribeck", joint, 0.0, {1.0})), Error);
  EXPECT_THROW(assemble(effect("glue", joint, 0.0, {1.0})), Error);
  EXPECT_THROW(assemble(effect("cubic_viscous", joint, 3.0, {1.0})), Error);
}

}  // namespace
}  // namespace kinescope
