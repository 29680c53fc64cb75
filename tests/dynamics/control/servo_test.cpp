// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/servo.h"

#include <gtest/gtest.h>

#include "dynamics/experiments/reference_arms.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

DynamicModel arm() {
  DynamicModel out = panda_arm();
  for (const JointId id : moving_joints(out.tree)) {
    out.joints[id.index()] = {.viscous = 0.5, .coulomb = 0.3, .motor_inertia = 0.1};
  }
  return out;
}

TorqueSamples reference(const DynamicModel& model) {
  Rng rng = Rng::from_name("Servo.reference");
  return sinusoid_log(model, {.samples = 2000, .rate_hz = 1000.0}, rng);
}

ServoLog log_of(const ServoOptions& options, std::uint64_t seed = 1) {
  const DynamicModel model = arm();
  Rng rng(seed);
  return run_servo(make_plant(with_effects(model)), reference(model), options, rng);
}

TEST(Servo, LoggedTorquesAreThoseOfTheLoggedMotion) {
  const ServoLog log = log_of({});
  const Eigen::MatrixXd expected = predict_torque(with_effects(arm()), log.samples);
  // Rounding; friction of a joint that turns round within a period is not that of its sign.
  for (Eigen::Index i = 1; i < expected.rows(); ++i) {
    for (Eigen::Index j = 0; j < 7; ++j) {
      if (std::abs(log.samples.dq(i, j)) < 1e-2) continue;
      ASSERT_NEAR(expected(i, j), log.samples.torque(i, j), 1e-7) << i << " joint " << j;
    }
  }
  EXPECT_LT(log.tracking_error.maxCoeff(), 1e-2);
}

TEST(Servo, FrictionCostsASlowLoopMore) {
  EXPECT_GT(log_of({.bandwidth_hz = 2.0}).tracking_error.maxCoeff(),
            3.0 * log_of({.bandwidth_hz = 20.0}).tracking_error.maxCoeff());
}

TEST(Servo, FeedForwardSparesTheLoopItsError) {
  EXPECT_GT(log_of({.law = ControlLaw::kPd}).tracking_error.maxCoeff(),
            3.0 * log_of({}).tracking_error.maxCoeff());
}

TEST(Servo, KeepsItsTorqueLimits) {
  ServoOptions options;
  options.torque_limit = Eigen::VectorXd::Constant(7, 5.0);
  const ServoLog log = log_of(options);
  EXPECT_LE(log.samples.torque.cwiseAbs().maxCoeff(), 5.0 + 1e-12);
  EXPECT_EQ(log.samples.torque.cwiseAbs().maxCoeff(), 5.0);
}

TEST(Servo, PositionsAreThoseOfTheEncoders) {
  constexpr double kStep = 1e-3;
  const ServoLog log = log_of({.encoder_step = kStep});
  const Eigen::MatrixXd steps = log.samples.q / kStep;
  EXPECT_LT((steps.array() - steps.array().round()).abs().maxCoeff(), 1e-9);
}

TEST(Servo, NoiseComesFromTheSeed) {
  const ServoOptions noisy{.torque_noise = 0.1};
  EXPECT_EQ(log_of(noisy, 7).samples.torque, log_of(noisy, 7).samples.torque);
  const Eigen::MatrixXd noise = log_of(noisy, 7).samples.torque - log_of({}).samples.torque;
  EXPECT_NEAR(std::sqrt(noise.squaredNorm() / static_cast<double>(noise.size())), 0.1, 0.003);
  EXPECT_GT((log_of(noisy, 8).samples.torque - log_of(noisy, 7).samples.torque).norm(), 1.0);
}

TEST(Servo, ALateLoopIsUnstable) {
  // Half a period of the loop's own oscillation late.
  EXPECT_THROW((void)log_of({.bandwidth_hz = 50.0, .delay_s = 0.05}), Error);
}

TEST(Servo, RefusesOptionsThatMakeNoLoop) {
  EXPECT_THROW((void)log_of({.rate_hz = 0.0}), Error);
  EXPECT_THROW((void)log_of({.steps = 0}), Error);
  EXPECT_THROW((void)log_of({.bandwidth_hz = std::nan("")}), Error);
  EXPECT_THROW((void)log_of({.kp = Eigen::VectorXd::Ones(3)}), Error);
  EXPECT_THROW((void)log_of({.encoder_step = -1.0}), Error);
}

}  // namespace
}  // namespace kinescope
