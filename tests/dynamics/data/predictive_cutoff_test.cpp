// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/predictive_cutoff.h"

#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/data/rough_torque.h"
#include "kinematics/core/rng.h"
#include "tests/dynamics/data/log_world.h"

namespace kinescope {
namespace {

constexpr double kLogStepS = 0.01;

/// One joint that swings slowly between reversals, with dry friction.
TorqueLog slow_log() {
  constexpr double kSwing_hz = 0.1;
  constexpr double kFastest = 0.05;  // rad/s
  Rng rng = Rng::from_name("slow log");
  TorqueLog log;
  log.sources = {"slow"};
  log.joints = {{.name = "joint1"}};
  log.t_s = Eigen::VectorXd::LinSpaced(6000, 0.0, 59.99);
  log.q.resize(6000, 1);
  log.torque.resize(6000, 1);
  for (Eigen::Index i = 0; i < 6000; ++i) {
    const double phase = kTurn * kSwing_hz * log.t_s(i);
    log.q(i, 0) = -kFastest / (kTurn * kSwing_hz) * std::cos(phase) + rng.normal(1e-6);
    log.torque(i, 0) = std::tanh(20.0 * std::sin(phase)) + rng.normal(0.02);
  }
  log.trajectory = Eigen::VectorXi::Zero(6000);
  log.trajectory_names = {"slow"};
  return log;
}

// A tenth of a hertz is all that moves; the friction turns round in a hundredth of that time.
TEST(PredictiveCutoff, FollowsTheTurnsOfFrictionOfASlowMotion) {
  constexpr double kOfTheMotion_hz = 0.25;
  const TorqueLog log = slow_log();
  const std::vector<CutoffTrial> trials =
      try_cutoffs(log, kLogStepS, MotionSource::kPosition, kOfTheMotion_hz);
  ASSERT_FALSE(trials.empty());
  const double chosen = best_predicting_cutoff(trials, kOfTheMotion_hz);
  EXPECT_GT(chosen, 4.0 * kOfTheMotion_hz);
  EXPECT_LT(chosen, 0.4 / kLogStepS);
  EXPECT_GT(derive_motion(log).cutoff.cutoff_hz, 1.0);
}

TEST(PredictiveCutoff, StaysWhereNothingIsSignificantlyBetter) {
  constexpr double kOwn_hz = 2.0;
  EXPECT_EQ(best_predicting_cutoff({}, kOwn_hz), kOwn_hz);
  EXPECT_EQ(best_predicting_cutoff({{1.0, -3.0, 0.1}, {4.0, 1.0, 0.8}}, kOwn_hz), kOwn_hz);
  EXPECT_EQ(best_predicting_cutoff({{1.0, -3.0, 0.1}, {8.0, 1.0, 0.1}}, kOwn_hz), 8.0);
}

TEST(PredictiveCutoff, TakesTheNearestOfThoseThatDoAsWell) {
  const std::vector<CutoffTrial> trials{{4.0, 0.95, 0.1}, {8.0, 1.0, 0.1}, {16.0, 0.99, 0.1}};
  EXPECT_EQ(best_predicting_cutoff(trials, 2.0), 4.0);
}

TEST(NarrowWidth, IsATenthOfAnUsualSpeedWhateverAFewPeaks) {
  Eigen::VectorXd speed = Eigen::VectorXd::Constant(100, -0.003);
  speed.head(5).setConstant(2.0);
  EXPECT_NEAR(narrow_width(speed), 0.0003, 1e-9);
  EXPECT_EQ(narrow_width(Eigen::VectorXd::Zero(100)), 0.0);
}

TEST(PredictiveCutoff, OfALogWithoutTorqueSaysNothing) {
  TorqueLog log = slow_log();
  log.torque.resize(6000, 0);
  EXPECT_TRUE(try_cutoffs(log, kLogStepS, MotionSource::kPosition, 1.0).empty());
}

}  // namespace
}  // namespace kinescope
