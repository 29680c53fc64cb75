// SPDX-License-Identifier: Apache-2.0
//
// A controller has what a log is predicted with: effects one sample after another, those with a
// memory too.
#include "dynamics/control/online_torque.h"

#include <gtest/gtest.h>

#include "dynamics/experiments/reference_arms.h"

namespace kinescope {
namespace {

struct Case {
  const char* effect;
  const char* place;
  double scan;
  std::vector<double> values;
  double tolerance;  ///< N m
  friend std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.effect; }
};

// Double precision through seven bodies.
constexpr double kRounding = 1e-10;
// Of 0.9 N m: a reversal within a period of 1 ms, in which a joint moves 3e-5 of the length.
constexpr double kReversal = 1e-4;

const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"viscous", "joint2", 0.0, {3.0}, kRounding},
      {"coulomb", "joint3", 0.0, {2.0}, kRounding},
      {"asymmetric", "joint4", 0.0, {0.7}, kRounding},
      {"stribeck", "joint1", 0.2, {1.5}, kRounding},
      {"cubic_viscous", "joint5", 3.0, {0.8}, kRounding},
      {"load_friction", "joint2", 0.0, {0.1}, kRounding},
      {"position_friction", "joint6", 2.0, {0.3, -0.2}, kRounding},
      {"hysteresis", "joint4", 0.05, {0.9}, kReversal},
      {"motor_inertia", "joint7", 0.0, {0.02}, kRounding},
      {"spring", "joint2", 0.0, {4.0, -1.0}, kRounding},
      {"ripple", "joint4", 31.0, {0.5, 0.2}, kRounding},
      {"drift", "joint3", 5.0, {0.4, 0.3, 0.2}, kRounding},
      {"torque_offset", "joint1", 0.0, {0.6}, kRounding},
      {"cross_talk", "joint5 + joint6", 0.0, {0.2, 0.1, 0.01}, kRounding},
      {"payload",
       "link7",
       0.0,
       {0.5, 0.01, 0.02, 0.05, 0.01, 0.0, 0.0, 0.01, 0.0, 0.01},
       kRounding},
      {"gravity_direction", "base", 0.0, {20.0, -10.0}, kRounding},
  };
  return all;
}

class Online : public testing::TestWithParam<Case> {};

TEST_P(Online, IsThePredictionOfTheLog) {
  const Case& c = GetParam();
  DynamicModel arm = panda_arm();
  for (const JointId id : moving_joints(arm.tree)) arm.joints[id.index()].viscous = 0.2;
  Rng rng = Rng::from_name("Online.motion");
  const TorqueSamples motion = sinusoid_log(arm, {.samples = 3000, .rate_hz = 1000.0}, rng);
  TorqueEffect effect;
  effect.id = {c.effect, c.place};
  effect.scan = c.scan;
  effect.values = Eigen::Map<const Eigen::VectorXd>(c.values.data(), std::ssize(c.values));
  const std::vector<JointTravel> travels(7, {.range = 2.0, .rms_speed = 0.4, .high_speed = 0.9});
  const CorrectedTorqueModel model =
      with_effects(arm, {effect}, travels, {.begin_s = 0.0, .duration_s = 3.0});
  const Eigen::MatrixXd expected = predict_torque(model, motion);
  EXPECT_GT((predict_torque(with_effects(arm), motion) - expected).norm(), 1e-3 * expected.norm());
  OnlineTorque online(make_plant(model));
  for (Eigen::Index i = 0; i < motion.size(); ++i) {
    const Eigen::VectorXd torque =
        online.at({motion.t_s[i], motion.q.row(i), motion.dq.row(i), motion.ddq.row(i)});
    ASSERT_LT((torque - expected.row(i).transpose()).lpNorm<Eigen::Infinity>(), c.tolerance)
        << c.effect << " sample " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(EveryEffect, Online, testing::ValuesIn(cases()),
                         [](const testing::TestParamInfo<Case>& param) {
                           return std::string(param.param.effect) + "_" +
                                  std::to_string(param.index);
                         });

TEST(Online, AtRestNothingRubs) {
  DynamicModel arm = panda_arm();
  TorqueEffect effect;
  effect.id = {"hysteresis", "joint4"};
  effect.scan = 0.05;
  effect.values = Eigen::VectorXd::Constant(1, 0.9);
  const Plant plant = make_plant(with_effects(arm, {effect}));
  OnlineTorque online(plant);
  const Eigen::VectorXd q = Eigen::VectorXd::Constant(7, -0.5);
  const Eigen::VectorXd slow = Eigen::VectorXd::Constant(7, 1e-9);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(7);
  EXPECT_EQ(online.at_rest(q, 0.0), OnlineTorque(make_plant(with_effects(arm))).at_rest(q, 0.0));
  // Asked in between, the memory stays.
  (void)online.at({0.0, q, slow, none});
  (void)online.at_rest(2.0 * q, 0.0);
  OnlineTorque other(plant);
  (void)other.at({0.0, q, slow, none});
  EXPECT_EQ(online.at({0.1, 0.99 * q, slow, none}), other.at({0.1, 0.99 * q, slow, none}));
}

}  // namespace
}  // namespace kinescope
