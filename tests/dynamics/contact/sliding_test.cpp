// SPDX-License-Identifier: Apache-2.0
//
// Drives that slide and stick: when each is said, what friction a log shows, and what is evidence.
#include <gtest/gtest.h>

#include "dynamics/contact/contact.h"
#include "dynamics/contact/drive_friction.h"
#include "tests/truth/drive_world.h"

namespace kinescope {
namespace {

using namespace experiments;

constexpr double kStep_s = 0.004;

/// Rest, forward, rest, backward, a second each.
Eigen::MatrixXd there_and_back(double speed_rad_s, Eigen::VectorXd& t_s) {
  const Eigen::Index rows = 1000;
  t_s = Eigen::VectorXd::LinSpaced(rows, 0.0, kStep_s * static_cast<double>(rows - 1));
  Eigen::MatrixXd q = Eigen::MatrixXd::Zero(rows, 1);
  for (Eigen::Index k = 1; k < rows; ++k) {
    const double rate = (k / 250 % 2 == 0 ? 0.0 : k < 500 ? 1.0 : -1.0) * speed_rad_s;
    q(k, 0) = q(k - 1, 0) + kStep_s * rate;
  }
  return q;
}

TEST(Sliding, BeginsAfterPreslidingAndEndsWithRest) {
  const RigidModel model = make_rigid_model(contact_arm(1));
  Eigen::VectorXd t_s;
  const Eigen::MatrixXd q = there_and_back(0.1, t_s);
  const Eigen::MatrixXi states = sliding_states(model, t_s, q);
  for (Eigen::Index k = 0; k < q.rows(); ++k) {
    if (k / 250 % 2 == 0) {
      EXPECT_EQ(states(k, 0), 0) << k;
    }
  }
  EXPECT_EQ(states(375, 0), 1);
  EXPECT_EQ(states(875, 0), -1);
  // 3 mrad at 0.1 rad/s, from when the motion before is a motion too.
  EXPECT_EQ(states(255, 0), 0);
  EXPECT_EQ(states(275, 0), 1);
}

TEST(Sliding, SlowerThanTheNoiseIsRest) {
  const RigidModel model = make_rigid_model(contact_arm(1));
  Rng rng = Rng::from_name("sliding.noise");
  Eigen::VectorXd t_s;
  Eigen::MatrixXd q = there_and_back(0.01, t_s);
  for (double& value : q.reshaped()) value += rng.normal(1e-3);
  EXPECT_TRUE(sliding_states(model, t_s, q).isZero());
}

struct Drives {
  DynamicModel model = contact_arm(2);
  RigidModel rigid = make_rigid_model(model);
  ContactWorld world;
  std::vector<SlidingFriction> friction;

  explicit Drives(const DriveWorldOptions& options) {
    Rng rng = Rng::from_name("sliding.drives");
    world = drive_world(model, options, rng);
    friction = sliding_friction(rigid, {world.samples});
  }
};

TEST(Sliding, FrictionIsThatOfTheLog) {
  const Drives drives({.duration_s = 60.0, .speed_rad_s = 0.08});
  for (const SlidingFriction& own : drives.friction) {
    ASSERT_TRUE(own.slides_forward && own.slides_backward);
    EXPECT_NEAR(own.coulomb, 1.0, 0.03);
    EXPECT_NEAR(own.offset, 0.0, 0.03);
    EXPECT_NEAR(own.stribeck, 0.25, 0.1);
    EXPECT_LT(own.lowest, -1.3);  // breakaway is 1.3
    EXPECT_GT(own.highest, 1.3);
  }
}

// Between the speeds that the search begins with, half an octave from the next.
TEST(Sliding, SpeedOfSlowFrictionIsFoundBetweenTheFirstGuesses) {
  const RigidModel model = make_rigid_model(contact_arm(1));
  constexpr double kSpeed = 0.0283;
  const Eigen::Index rows = 8000;
  TorqueSamples motion;
  motion.t_s = Eigen::VectorXd::LinSpaced(rows, 0.0, kStep_s * static_cast<double>(rows - 1));
  motion.q = (0.4 * motion.t_s.array()).sin().matrix() * 0.3;
  motion.dq = (0.4 * motion.t_s.array()).cos().matrix() * 0.12;
  motion.torque = Eigen::VectorXd::Zero(rows);
  motion.trajectory = Eigen::VectorXi::Zero(rows);
  Rng rng = Rng::from_name("sliding.stribeck");
  Eigen::MatrixXd residual(rows, 1);
  for (Eigen::Index k = 0; k < rows; ++k) {
    const double dq = motion.dq(k, 0);
    const double low = dq / kSpeed;
    residual(k, 0) =
        (dq > 0.0 ? 1.0 : -1.0) * (1.0 + 0.5 * std::exp(-low * low)) + 2.0 * dq + rng.normal(0.02);
  }
  const SlidingFriction own = sliding_friction(model, {motion}, {residual}).front();
  EXPECT_NEAR(own.stribeck_speed, kSpeed, 0.03 * kSpeed);
  EXPECT_NEAR(own.stribeck, 0.5, 0.01);
  EXPECT_NEAR(own.coulomb, 1.0, 0.01);
}

// A gear that winds up: friction comes over ten times the usual way, and what it lacks there is no
// push.
TEST(Sliding, HowFarAJointMovesUntilItSlidesIsWhatItsTurnsShow) {
  const SlidingOptions usual;
  const Drives stiff({.duration_s = 60.0});
  for (const SlidingFriction& own : stiff.friction) EXPECT_EQ(own.presliding, usual.presliding_rad);
  constexpr double kWindsUp = 5e-3;  // rad
  const Drives soft({.duration_s = 60.0, .presliding_rad = kWindsUp});
  for (const SlidingFriction& own : soft.friction) {
    EXPECT_GE(own.presliding, 2.0 * kWindsUp);
    EXPECT_LE(own.presliding, 8.0 * kWindsUp);
  }
  const auto most = [](const Drives& drives) {
    double out = 0.0;
    for (const BalanceSample& sample :
         sliding_balance(drives.rigid, drives.friction, drives.world.samples)) {
      for (Eigen::Index j = 0; j < sample.drive.size(); ++j) {
        const double sigma = drives.friction[static_cast<std::size_t>(j)].sigma;
        if (!sample.may_stick(j)) out = std::max(out, std::abs(sample.drive[j]) / sigma);
      }
    }
    return out;
  };
  EXPECT_LT(most(soft), 1.5 * most(stiff));
}

TEST(Sliding, StickingIsNoEvidenceWithinItsInterval) {
  const Drives drives({.duration_s = 30.0, .speed_rad_s = 0.5});
  TorqueSamples held = drives.world.samples;
  const auto balance = [&](double more_nm) {
    TorqueSamples pushed = held;
    pushed.torque.col(0).array() += more_nm;
    return sliding_balance(drives.rigid, drives.friction, pushed);
  };
  // The last rest: what friction holds is between -1 and 1 N m.
  const std::vector<BalanceSample> free = balance(0.0);
  std::size_t rest = free.size();
  for (std::size_t k = free.size() / 2; k < free.size(); ++k) {
    if (held.dq.row(static_cast<Eigen::Index>(k)).cwiseAbs().maxCoeff() < 4e-3) rest = k;
  }
  ASSERT_LT(rest, free.size());
  ASSERT_TRUE(free[rest].may_stick(0));
  constexpr double kSlope = 0.1;  // N m, of the momentum's noise
  EXPECT_NEAR(free[rest].drive[0], 0.0, kSlope);
  EXPECT_GT(balance(6.0)[rest].drive[0], 3.0);
  EXPECT_LT(balance(-6.0)[rest].drive[0], -3.0);
}

// Cut off at a limit it is at least so large: less than expected says nothing, more does.
TEST(Sliding, ATorqueAtItsLimitIsAtLeastSoLarge) {
  const Drives drives({.duration_s = 30.0, .speed_rad_s = 0.5});
  const TorqueSamples& free = drives.world.samples;
  const Eigen::VectorXd torque = free.torque.col(0);
  const auto balance = [&](double limit, const Eigen::VectorXd& truth, bool at_limit) {
    TorqueSamples cut = free;
    cut.torque_missing = MissingTorque::Constant(free.size(), free.joints(), false);
    for (Eigen::Index k = 0; k < free.size(); ++k) {
      cut.torque(k, 0) = std::min(limit, truth(k));
      cut.torque_missing(k, 0) = truth(k) >= limit;
      if (!at_limit && cut.torque_missing(k, 0)) cut.torque(k, 0) = 0.0;
    }
    return sliding_balance(drives.rigid, drives.friction, cut);
  };
  const auto sliding = sliding_states(drives.rigid, free);
  // Less than the drive gives.
  const double limit = 0.5;  // N m; friction takes 1
  const std::vector<BalanceSample> cut = balance(limit, torque, true);
  const std::vector<BalanceSample> lost = balance(limit, torque, false);
  constexpr double kClear = 0.3;  // N m, of the noise
  int looked_at = 0;
  for (Eigen::Index k = 0; k < free.size(); ++k) {
    if (torque(k) < limit + kClear || sliding(k, 0) == 0) continue;
    ++looked_at;
    const auto at = static_cast<std::size_t>(k);
    EXPECT_TRUE(cut[at].may_stick(0));
    EXPECT_EQ(cut[at].drive[0], lost[at].drive[0]) << k;
  }
  EXPECT_GT(looked_at, 100);
  // A push as far as the limit.
  constexpr double kPush = 6.0;  // N m
  Eigen::VectorXd pushed = torque;
  Eigen::Index row = free.size() / 2;
  while (sliding(row, 0) == 0) ++row;
  pushed(row) = torque.maxCoeff() + 2.0 * kPush;
  const double far = torque.maxCoeff() + kPush;
  const auto at = static_cast<std::size_t>(row);
  EXPECT_GT(balance(far, pushed, true)[at].drive[0] - balance(far, pushed, false)[at].drive[0],
            0.9 * kPush);
}

// All within the friction's interval: the momentum that it breaks away with comes at once.
TEST(Sliding, NothingPushesBeforeABreakaway) {
  const RigidModel model = make_rigid_model(contact_arm(1));
  constexpr double kStart_s = 1.0;
  constexpr double kAcceleration = 4.0;  // rad/s^2
  const Eigen::Index rows = 500;
  TorqueSamples motion;
  motion.t_s = Eigen::VectorXd::LinSpaced(rows, 0.0, kStep_s * static_cast<double>(rows - 1));
  const Eigen::ArrayXd since = (motion.t_s.array() - kStart_s).max(0.0);
  motion.q = (0.5 * kAcceleration * since.square()).matrix();
  motion.dq = (kAcceleration * since).matrix();
  motion.torque = Eigen::VectorXd::Zero(rows);
  motion.trajectory = Eigen::VectorXi::Zero(rows);
  SlidingFriction any;
  any.slides_forward = any.slides_backward = true;
  any.lowest = -1e6;
  any.highest = 1e6;
  const std::vector<BalanceSample> balance = sliding_balance(model, {any}, motion);
  const double per_step = balance.back().mass(0, 0) * kAcceleration * kStep_s;
  for (std::size_t k = 1; balance[k].may_stick(0); ++k) {
    const double gained = balance[k].momentum[0] - balance[k - 1].momentum[0];
    const double told = 0.5 * kStep_s * (balance[k].drive[0] + balance[k - 1].drive[0]);
    EXPECT_NEAR(told, gained, 0.3 * per_step) << motion.t_s[static_cast<Eigen::Index>(k)];
    if (balance[k].stamp_s < kStart_s - 2.0 * kStep_s) {
      EXPECT_NEAR(told, 0.0, 1e-12);
    }
  }
}

TEST(Sliding, StopAndGoHasNoContact) {
  const Drives drives({.duration_s = 60.0});
  const std::vector<BalanceSample> samples =
      sliding_balance(drives.rigid, drives.friction, drives.world.samples);
  EXPECT_TRUE(detect_contacts(calibrate_contacts(samples), samples).empty());
}

TEST(Sliding, ASweepIntoAnObstacleIsAContact) {
  const Drives drives(
      {.speed_rad_s = 0.1, .one_way = true, .obstacle_s = 10.0, .obstacle_nm = 2.0});
  EXPECT_FALSE(drives.friction[1].known());
  const std::vector<BalanceSample> samples =
      sliding_balance(drives.rigid, drives.friction, drives.world.samples);
  const std::vector<ContactEvent> events = detect_contacts(calibrate_contacts(samples), samples);
  ASSERT_FALSE(events.empty());
  EXPECT_GT(events.front().alarm_s, 10.0);
  EXPECT_LT(events.front().alarm_s, 10.4);
}

}  // namespace
}  // namespace kinescope
