// SPDX-License-Identifier: Apache-2.0
//
// The residual of a torque model as what the detector sees: friction at rest, doubt, and what the
// model's low-pass takes from the motion.
#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/contact/contact.h"
#include "dynamics/contact/contact_score.h"
#include "dynamics/contact/drive_friction.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "tests/truth/drive_world.h"

namespace kinescope {
namespace {

using namespace experiments;

/// A model that knows the masses and, at any speed, Coulomb friction as the sign of the rate.
PredictedTorque prediction(const RigidModel& rigid, const TorqueSamples& motion) {
  PredictedTorque out;
  out.frictionless = inverse_dynamics_of_samples(rigid, motion.q, motion.dq, motion.ddq);
  constexpr double kWidth = 0.01;  // rad/s
  out.mean = out.frictionless + (motion.dq / kWidth).array().tanh().matrix();
  out.sigma = Eigen::MatrixXd::Constant(motion.size(), motion.joints(), 0.1);
  return out;
}

struct Predicted {
  DynamicModel model = contact_arm(2);
  RigidModel rigid = make_rigid_model(model);
  TorqueSamples motion;
  PredictedTorque torque;
  std::vector<PredictedFriction> friction;

  explicit Predicted(const DriveWorldOptions& options) {
    Rng rng = Rng::from_name("predicted balance");
    motion = drive_world(model, options, rng).samples;
    torque = prediction(rigid, motion);
    friction = predicted_friction(rigid, {motion}, {torque});
  }
  [[nodiscard]] std::vector<BalanceSample> balance() const {
    return predicted_balance(rigid, friction, motion, torque);
  }
};

TEST(PredictedBalance, FrictionIsThatOfTheDriveThoughTheModelHasIt) {
  const Predicted world({.duration_s = 40.0, .speed_rad_s = 0.3});
  for (const PredictedFriction& own : world.friction) {
    EXPECT_FALSE(own.may_be_all);
    EXPECT_NEAR(own.whole.coulomb, 1.0, 0.1);
    EXPECT_NEAR(own.correction.coulomb, 0.0, 0.1);
    EXPECT_LT(own.whole.lowest, -1.3);  // breakaway is 1.3
    EXPECT_GT(own.whole.highest, 1.3);
  }
}

TEST(PredictedBalance, RestIsNoEvidenceWithinFriction) {
  Predicted world({.duration_s = 30.0, .speed_rad_s = 0.5});
  const std::vector<BalanceSample> free = world.balance();
  std::size_t rest = 0;
  for (std::size_t k = 0; k < free.size(); ++k) {
    if (free[k].may_stick(0) && std::abs(world.motion.dq(static_cast<Eigen::Index>(k), 0)) < 1e-3)
      rest = k;
  }
  ASSERT_GT(rest, 0U);
  EXPECT_EQ(free[rest].drive[0], 0.0);
  world.motion.torque.col(0).array() += 6.0;
  EXPECT_GT(world.balance()[rest].drive[0], 3.0);
}

TEST(PredictedBalance, StopAndGoHasNoContact) {
  const Predicted world({.duration_s = 60.0});
  const std::vector<BalanceSample> samples = world.balance();
  EXPECT_TRUE(detect_contacts(calibrate_contacts(samples), samples).empty());
}

TEST(PredictedBalance, OneWayTellsFrictionFromNothing) {
  Predicted world({.speed_rad_s = 0.1, .one_way = true});
  ASSERT_TRUE(world.friction[0].may_be_all);
  EXPECT_FALSE(world.friction[1].whole.known());
  // All of the torque may turn round with the direction.
  const SlidingFriction& whole = world.friction[0].whole;
  EXPECT_NEAR(whole.lowest, -whole.highest, 1e-12);
  EXPECT_GT(whole.highest, std::abs(whole.offset));
}

/// What is a contact where the model knows the motion is none where it doubts itself ten times as
/// much.
TEST(PredictedBalance, ThresholdsWidenWhereTheModelHasNotBeen) {
  Rng rng = Rng::from_name("predicted balance doubt");
  constexpr Eigen::Index kRows = 6000;
  constexpr Eigen::Index kNew = 3000;    // from here on the motion is new
  constexpr Eigen::Index kPushed = 100;  // samples
  const Eigen::VectorXd t_s = Eigen::VectorXd::LinSpaced(kRows, 0.0, 0.01 * (kRows - 1));
  Eigen::MatrixXd sigma = Eigen::MatrixXd::Constant(kRows, 1, 0.1);
  sigma.bottomRows(kRows - kNew).setConstant(1.0);
  Eigen::MatrixXd torque(kRows, 1);
  double error = 0.0;
  for (Eigen::Index t = 0; t < kRows; ++t) {
    const double kept = std::exp(-0.01 / 0.5);  // correlation time 0.5 s
    error = kept * error + std::sqrt(1.0 - kept * kept) * rng.normal(sigma(t, 0));
    torque(t, 0) = error + rng.normal(0.02);
  }
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(kRows, 1);
  const ContactCalibration calibration =
      calibrate_contacts(balance_samples(t_s, torque, none, sigma));
  for (const Eigen::Index at : {1500, 4500}) {
    Eigen::MatrixXd pushed = torque;
    pushed.col(0).segment(at, kPushed).array() += 0.5;
    const auto events = detect_contacts(calibration, balance_samples(t_s, pushed, none, sigma));
    EXPECT_EQ(events.empty(), at > kNew) << at;
  }
}

/// The low-pass shows no acceleration at all: inertia times the speed beyond its own makes it up.
TEST(PredictedBalance, InertiaMakesUpForWhatTheLowPassTakes) {
  constexpr Eigen::Index kRows = 2000;
  constexpr double kInertia = 2.0;  // kg m^2
  TorqueSamples motion;
  motion.t_s = Eigen::VectorXd::LinSpaced(kRows, 0.0, 0.002 * (kRows - 1));
  const Eigen::VectorXd angle = 9.0 * motion.t_s;
  motion.q = (0.5 * angle.array().sin() / 9.0).matrix() + 0.2 * motion.t_s;
  motion.dq = (0.5 * angle.array().cos() + 0.2).matrix();
  motion.torque = -kInertia * 4.5 * angle.array().sin().matrix();
  motion.trajectory = Eigen::VectorXi::Zero(kRows);
  PredictedTorque torque;
  torque.mean = torque.frictionless = Eigen::MatrixXd::Zero(kRows, 1);
  torque.sigma = Eigen::MatrixXd::Constant(kRows, 1, 0.1);
  torque.inertia.assign(kRows, Eigen::MatrixXd::Constant(1, 1, kInertia));
  torque.speed = Eigen::MatrixXd::Constant(kRows, 1, 0.2);
  const RigidModel rigid = make_rigid_model(contact_arm(1));
  const auto friction = predicted_friction(rigid, {motion}, {torque});
  const std::vector<BalanceSample> samples = predicted_balance(rigid, friction, motion, torque);
  double largest = 0.0;
  for (std::size_t k = 1; k < samples.size(); ++k) {
    if (samples[k].may_stick(0)) continue;
    const double impulse = samples[k].momentum[0] - samples[k - 1].momentum[0] -
                           0.001 * (samples[k].drive[0] + samples[k - 1].drive[0]);
    largest = std::max(largest, std::abs(impulse));
  }
  // Without the momentum it would be 0.002 s times 9 N m.
  EXPECT_LT(largest, 0.02 * 0.002 * 9.0);
}

/// At constant speed a model has learned no inertia: what it has is noise, times that of speeds.
TEST(PredictedBalance, InertiaThatNoMotionShowsIsLeftOut) {
  Rng rng = Rng::from_name("predicted balance inertia");
  constexpr Eigen::Index kRows = 4000;
  TorqueSamples motion;
  motion.t_s = Eigen::VectorXd::LinSpaced(kRows, 0.0, 0.004 * (kRows - 1));
  motion.q = 0.2 * motion.t_s;
  motion.dq = Eigen::MatrixXd::Constant(kRows, 1, 0.2);
  motion.torque = Eigen::MatrixXd::Zero(kRows, 1);
  motion.trajectory = Eigen::VectorXi::Zero(kRows);
  for (double& value : motion.dq.reshaped()) value += rng.normal(0.002);
  for (double& value : motion.torque.reshaped()) value += rng.normal(0.05);
  const RigidModel rigid = make_rigid_model(contact_arm(1));
  PredictedTorque torque;
  torque.mean = torque.frictionless = Eigen::MatrixXd::Zero(kRows, 1);
  torque.sigma = Eigen::MatrixXd::Constant(kRows, 1, 0.1);
  torque.speed = Eigen::MatrixXd::Constant(kRows, 1, 0.2);
  for (const double inertia : {0.01, 20.0}) {
    const Eigen::Index n = rigid.size();
    torque.inertia.assign(kRows, Eigen::MatrixXd::Constant(n, n, inertia));
    const std::vector<char> usable = usable_inertia(rigid, {motion}, {torque});
    EXPECT_EQ(usable.at(0), inertia < 1.0 ? 1 : 0) << inertia;
    EXPECT_EQ(with_inertia_of(torque, usable).inertia[0](0, 0), inertia < 1.0 ? inertia : 0.0);
  }
}

/// A log that begins and ends in motion, and a low-pass that shows no acceleration at its ends.
/// Noise of speeds, over some 50 ms, is more torque than the low-pass takes from most of the
/// motion.
class InertiaBehindNoisySpeeds : public testing::Test {
 protected:
  static constexpr Eigen::Index kRows = 10000;
  static constexpr double kStep_s = 0.002;
  static constexpr double kInertia = 3.0;       // kg m^2
  static constexpr double kHardest = 2.0;       // rad/s^2
  static constexpr double kOnwards = 1.0;       // rad/s: the joint never turns round
  static constexpr double kEnd_s = 0.04;        // without acceleration
  static constexpr double kSpeedNoise = 1e-3;   // rad/s
  static constexpr double kTorqueNoise = 0.02;  // N m

  InertiaBehindNoisySpeeds() {
    Rng rng = Rng::from_name("inertia behind noisy speeds");
    const double rate = 3.0;  // rad/s
    motion_.t_s = Eigen::VectorXd::LinSpaced(kRows, 0.0, kStep_s * (kRows - 1));
    const Eigen::ArrayXd angle = rate * motion_.t_s.array();
    const Eigen::VectorXd acceleration = kHardest * angle.cos();
    const Eigen::VectorXd speed = kOnwards + kHardest / rate * angle.sin();
    motion_.q = kOnwards * motion_.t_s.array() - kHardest / (rate * rate) * angle.cos();
    motion_.dq = speed;
    motion_.torque = kInertia * acceleration;
    motion_.trajectory = Eigen::VectorXi::Zero(kRows);
    for (double& value : motion_.dq.reshaped()) value += rng.normal(kSpeedNoise);
    for (double& value : motion_.torque.reshaped()) value += rng.normal(kTorqueNoise);
    const double last_s = motion_.t_s[kRows - 1];
    Eigen::VectorXd shown = acceleration;
    predicted_.speed = speed.row(0);
    predicted_.speed.conservativeResize(kRows, 1);
    for (Eigen::Index t = 0; t < kRows; ++t) {
      if (std::min(motion_.t_s[t], last_s - motion_.t_s[t]) < kEnd_s) shown[t] = 0.0;
      if (t > 0)
        predicted_.speed(t, 0) =
            predicted_.speed(t - 1, 0) + 0.5 * kStep_s * (shown[t] + shown[t - 1]);
    }
    predicted_.mean = predicted_.frictionless = kInertia * shown;
    predicted_.sigma = Eigen::MatrixXd::Constant(kRows, 1, kTorqueNoise);
    predicted_.inertia.assign(kRows, Eigen::MatrixXd::Constant(1, 1, kInertia));
  }
  [[nodiscard]] std::vector<ContactEvent> contacts(const TorqueSamples& motion) const {
    const PredictedTorque used =
        with_inertia_of(predicted_, usable_inertia(rigid_, {motion}, {predicted_}));
    const std::vector<BalanceSample> samples =
        predicted_balance(rigid_, predicted_friction(rigid_, {motion}, {used}), motion, used);
    return detect_contacts(calibrate_contacts(samples), samples);
  }

  RigidModel rigid_ = make_rigid_model(contact_arm(1));
  TorqueSamples motion_;
  PredictedTorque predicted_;
};

TEST_F(InertiaBehindNoisySpeeds, IsUsedWhereTheMotionShowsIt) {
  EXPECT_EQ(usable_inertia(rigid_, {motion_}, {predicted_}).at(0), 1);
}

TEST_F(InertiaBehindNoisySpeeds, EndsInMotionAreNoContacts) {
  EXPECT_TRUE(contacts(motion_).empty());
}

TEST_F(InertiaBehindNoisySpeeds, AContactAtTheEndIsFound) {
  constexpr double kPush = 3.0;          // N m
  constexpr Eigen::Index kPushed = 100;  // samples, the last ones
  TorqueSamples pushed = motion_;
  pushed.torque.bottomRows(kPushed).array() += kPush;
  const std::vector<ContactEvent> found = contacts(pushed);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].onset_s, motion_.t_s[kRows - kPushed], 0.02);
  EXPECT_TRUE(found[0].cut_off);
}

}  // namespace
}  // namespace kinescope
