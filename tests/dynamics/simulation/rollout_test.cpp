// SPDX-License-Identifier: Apache-2.0
#include "dynamics/simulation/rollout.h"

#include <gtest/gtest.h>

#include "dynamics/control/servo.h"
#include "dynamics/experiments/reference_arms.h"

namespace kinescope {
namespace {

DynamicModel arm() {
  DynamicModel out = panda_arm();
  for (const JointId id : moving_joints(out.tree)) out.joints[id.index()].motor_inertia = 0.1;
  return out;
}

std::vector<TorqueEffect> friction(const DynamicModel& model) {
  std::vector<TorqueEffect> out;
  for (const JointId id : moving_joints(model.tree)) {
    TorqueEffect coulomb;
    coulomb.id = {"coulomb", model.tree.joints[id.index()].name};
    coulomb.values = Eigen::VectorXd::Constant(1, 0.8);
    TorqueEffect viscous = coulomb;
    viscous.id.effect = "viscous";
    out.push_back(coulomb);
    out.push_back(viscous);
  }
  return out;
}

TorqueSamples log_of(const CorrectedTorqueModel& model) {
  Rng rng = Rng::from_name("Rollout.log");
  const TorqueSamples reference =
      sinusoid_log(model.model, {.samples = 6000, .rate_hz = 1000.0}, rng);
  return run_servo(make_plant(model), reference, {}, rng).samples;
}

TEST(Rollout, TheTrueModelFollowsItsOwnLog) {
  const DynamicModel model = arm();
  const CorrectedTorqueModel truth = with_effects(model, friction(model));
  const TorqueSamples log = log_of(truth);
  const Rollout out = roll_out(truth, model.tree, log, {.step_s = 5e-4});
  ASSERT_EQ(out.failure, "");
  ASSERT_EQ(out.horizons.size(), 3U);
  EXPECT_FALSE(out.tip.empty());
  for (const RolloutHorizon& horizon : out.horizons) {
    EXPECT_GE(horizon.windows, 4) << horizon.horizon_s;
    EXPECT_LT(horizon.with_effects.joints.maxCoeff(), 0.05 * horizon.held.joints.maxCoeff());
    EXPECT_LT(horizon.with_effects.tool_m, 0.05 * horizon.held.tool_m);
    EXPECT_GT(horizon.without_effects.tool_m, 5.0 * horizon.with_effects.tool_m);
  }
  EXPECT_LT(out.horizons[0].with_effects.tool_m, out.horizons[2].with_effects.tool_m);
}

TEST(Rollout, UndoesWhatTheSensorsDo) {
  const DynamicModel model = arm();
  std::vector<TorqueEffect> effects = friction(model);
  const std::string joint = model.tree.joints[moving_joints(model.tree)[1].index()].name;
  for (const auto& [name, value] :
       {std::pair{"torque_gain", 0.2}, {"torque_delay", 0.02}, {"torque_lag", 0.03}}) {
    TorqueEffect sensor;
    sensor.id = {name, joint};
    sensor.values = Eigen::VectorXd::Constant(1, value);
    effects.push_back(sensor);
  }
  const CorrectedTorqueModel truth = with_effects(model, effects);
  const Rollout out = roll_out(truth, model.tree, log_of(truth), {.horizons_s = {0.5}});
  ASSERT_EQ(out.failure, "");
  EXPECT_LT(out.horizons[0].with_effects.joints[1], 0.1 * out.horizons[0].held.joints[1]);
  EXPECT_GT(out.horizons[0].without_effects.joints[1], out.horizons[0].with_effects.joints[1]);
}

TEST(Rollout, SaysWhyThereIsNone) {
  const DynamicModel model = arm();
  TorqueSamples log = log_of(with_effects(model));
  const Rollout brief = roll_out(with_effects(model), model.tree, log, {.horizons_s = {100.0}});
  EXPECT_EQ(brief.failure, "the log is too short");
  DynamicModel weightless = model;
  for (InertialParameters& link : weightless.links) link = {};
  for (JointDynamics& joint : weightless.joints) joint = {};
  EXPECT_NE(roll_out(with_effects(weightless), model.tree, log).failure, "");
}

}  // namespace
}  // namespace kinescope
