// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/second_column.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kNoise = 0.005 * kDegree;  // of an encoder
constexpr double kRate_hz = 100.0;
constexpr double kLag_s = 0.06;
constexpr double kBand = 1.0 * kDegree;
constexpr double kDroop = 2.0 * kDegree;
const Eigen::Vector3d kDown(0.0, 0.0, -1.0);

// What the drives do between command and encoder.
struct Drive {
  double lag_s = 0.0;
  double droop = 0.0;  // at the largest torque of gravity that the arm can have
  double band = 0.0;
  double scale = 0.0;  // the command says more
  double step = 0.0;   // of the command's digits
  double noise = kNoise;
  bool rests = false;
  double length_s = 20.0;
  std::uint64_t seed = 1;
  double speed = 1.0;
};

// Two links of 0.4 m that lift against gravity, axes along y.
KinematicTree arm() {
  KinematicTree tree;
  tree.links = {{"base"}, {"upper"}, {"fore"}};
  for (int j = 0; j < 2; ++j) {
    Joint joint;
    joint.name = "joint" + std::to_string(j + 1);
    joint.channel = "q" + std::to_string(j + 1);
    joint.type = JointType::kRevolute;
    joint.parent = LinkId{j};
    joint.child = LinkId{j + 1};
    joint.axis = -Eigen::Vector3d::UnitY();
    if (j > 0) joint.T_parent_joint.translation = {0.4, 0.0, 0.0};
    tree.joints.push_back(joint);
  }
  return tree;
}

// `copies`: a column, and the channel that it tells again.
KinematicTree with_copies(KinematicTree tree,
                          const std::vector<std::pair<std::string, std::string>>& copies) {
  for (const auto& [column, channel] : copies) {
    const auto joint = std::ranges::find(tree.joints, channel, &Joint::channel);
    if (joint != tree.joints.end()) joint->copies.push_back(column);
  }
  return tree;
}

// Moves for 2 s of every 3 where it rests: smooth time that stands still in between.
double own_time(double t, bool rests) {
  if (!rests) return t;
  constexpr double kPeriod_s = 3.0;
  constexpr double kMoving_s = 2.0;
  const double turn = std::floor(t / kPeriod_s);
  const double s = std::clamp((t - turn * kPeriod_s) / kMoving_s, 0.0, 1.0);
  return kPeriod_s * (turn + s * s * (3.0 - 2.0 * s));
}

double commanded(int joint, double t, bool rests) {
  const double s = own_time(t, rests);
  return joint == 0 ? 0.5 * std::sin(1.3 * s) + 0.25 * std::sin(2.9 * s + 0.4) + 0.3
                    : 0.6 * std::sin(1.7 * s + 1.0) + 0.2 * std::sin(3.7 * s) - 0.5;
}

// Torque of gravity about each joint, of the largest that there can be.
double torque(int joint, const Eigen::Vector2d& q) {
  constexpr double kUpper = 0.6;  // of the load; the rest is the fore arm's
  const double fore = (1.0 - kUpper) * std::cos(q[0] + q[1]);
  return joint == 0 ? kUpper * std::cos(q[0]) + fore : fore / (1.0 - kUpper);
}

// A drive with friction: it moves once its spring is stretched by more than half the band.
JointLog simulated(const Drive& drive) {
  constexpr double kStep_s = 1e-3;
  Rng rng(drive.seed);
  const auto command_at = [&](int joint, double t) {
    return commanded(joint, drive.speed * t, drive.rests);
  };
  JointLog log;
  log.channels = {"q1", "q2", "q1_cmd", "q2_cmd"};
  const auto samples = static_cast<Eigen::Index>(std::lround(drive.length_s * kRate_hz));
  log.values.resize(samples, 4);
  Eigen::Vector2d q(command_at(0, -1.0), command_at(1, -1.0));
  Eigen::Index sample = 0;
  for (int k = -1000; sample < samples; ++k) {
    const double t = k * kStep_s;
    const Eigen::Vector2d before = q;
    for (int pass = 0; pass < 3; ++pass) {
      for (int j = 0; j < 2; ++j) {
        const double target = command_at(j, t - drive.lag_s) - drive.droop * torque(j, q);
        q[j] = std::clamp(before[j], target - 0.5 * drive.band, target + 0.5 * drive.band);
      }
    }
    if (k < 0 || k % 10 != 0) continue;
    log.times_s.push_back(3.0 + t);
    for (int j = 0; j < 2; ++j) {
      log.values(sample, j) = q[j] + drive.noise * rng.normal();
      const double command = (1.0 + drive.scale) * command_at(j, t);
      log.values(sample, 2 + j) =
          drive.step > 0.0 ? drive.step * std::round(command / drive.step) : command;
    }
    ++sample;
  }
  return log;
}

// The same with a mass: a spring and a damper, damped critically.
JointLog servo(double bandwidth, double friction, double droop) {
  constexpr double kStep_s = 1e-4;
  constexpr int kSettling = 30000;
  Rng rng(5);
  JointLog log;
  log.channels = {"q1", "q2", "q1_cmd", "q2_cmd"};
  log.values.resize(2000, 4);
  Eigen::Vector2d q(commanded(0, -3.0, false), commanded(1, -3.0, false));
  Eigen::Vector2d rate(0.0, 0.0);
  const double most_friction = bandwidth * bandwidth * friction * kStep_s;
  Eigen::Index sample = 0;
  for (int k = -kSettling; sample < log.values.rows(); ++k) {
    const double t = k * kStep_s;
    for (int j = 0; j < 2; ++j) {
      const double stretched = commanded(j, t, false) - q[j] - droop * torque(j, q);
      rate[j] += kStep_s * bandwidth * (bandwidth * stretched - 2.0 * rate[j]);
      rate[j] -= std::clamp(rate[j], -most_friction, most_friction);
      q[j] += kStep_s * rate[j];
    }
    if (k < 0 || k % 100 != 0) continue;
    log.times_s.push_back(t);
    for (int j = 0; j < 2; ++j) {
      log.values(sample, j) = q[j] + kNoise * rng.normal();
      log.values(sample, 2 + j) = commanded(j, t, false);
    }
    ++sample;
  }
  return log;
}

std::vector<SecondColumn> both(const JointLog& log) {
  return second_columns(log, with_copies(arm(), {{"q1_cmd", "q1"}, {"q2_cmd", "q2"}}), kDown,
                        false);
}

const TracedEffect* find_effect(const SecondColumn& second, const std::string& name) {
  const auto found = std::ranges::find(second.trace.accepted, name,
                                       [](const TracedEffect& effect) { return effect.id.effect; });
  return found == second.trace.accepted.end() ? nullptr : &*found;
}

// Of one recording a 95 % interval may miss; twice as wide one hardly does.
void expect_size(const SecondColumn& second, const std::string& name, double truth) {
  const TracedEffect* effect = find_effect(second, name);
  ASSERT_NE(effect, nullptr) << name << " is not in: " << words_of(second);
  const double half = 0.5 * (effect->interval.high - effect->interval.low);
  EXPECT_NEAR(effect->size, truth, 2.0 * half) << words_of(second);
  EXPECT_NEAR(effect->size, truth, 0.02 * std::abs(truth)) << words_of(second);
}

// These effects and no others.
void expect_only(const SecondColumn& second, std::vector<std::string> names) {
  std::vector<std::string> found;
  for (const TracedEffect& effect : second.trace.accepted) found.push_back(effect.id.effect);
  std::ranges::sort(found);
  std::ranges::sort(names);
  EXPECT_EQ(found, names) << words_of(second);
}

// What is left is what the encoder adds.
void expect_noise_left(const SecondColumn& second, double noise = kNoise) {
  EXPECT_NEAR(second.after, noise, 0.1 * noise) << words_of(second);
  EXPECT_NE(words_of(second).find("is noise"), std::string::npos) << words_of(second);
}

// The largest torque on a joint in the recording.
double largest_torque(const JointLog& log, int joint) {
  double out = 0.0;
  for (Eigen::Index i = 0; i < log.values.rows(); ++i) {
    const Eigen::Vector2d q = log.values.row(i).head<2>().transpose();
    out = std::max(out, std::abs(torque(joint, q)));
  }
  return out;
}

class MovingAndResting : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(SecondColumn, MovingAndResting, testing::Bool());

TEST_P(MovingAndResting, ALag) {
  for (const SecondColumn& second : both(simulated({.lag_s = kLag_s, .rests = GetParam()}))) {
    expect_only(second, {"time_offset"});
    expect_size(second, "time_offset", kLag_s);
    expect_noise_left(second);
    EXPECT_GT(second.before, 100.0 * second.after);
  }
}

TEST_P(MovingAndResting, ADeadBand) {
  for (const SecondColumn& second : both(simulated({.band = kBand, .rests = GetParam()}))) {
    expect_only(second, {"dead_band"});
    expect_size(second, "dead_band", kBand);
    EXPECT_EQ(second.trace.accepted.front().id.place, second.joint);
    expect_noise_left(second);
  }
}

TEST_P(MovingAndResting, ADroop) {
  const JointLog log = simulated({.droop = kDroop, .rests = GetParam()});
  const std::vector<SecondColumn> seconds = both(log);
  for (int j = 0; j < 2; ++j) {
    const SecondColumn& second = seconds[static_cast<std::size_t>(j)];
    expect_only(second, {"droop"});
    expect_size(second, "droop", kDroop * largest_torque(log, j));
    EXPECT_FALSE(second.lifted);
    expect_noise_left(second);
  }
}

TEST_P(MovingAndResting, AllThreeTogether) {
  const JointLog log =
      simulated({.lag_s = kLag_s, .droop = kDroop, .band = kBand, .rests = GetParam()});
  const std::vector<SecondColumn> seconds = both(log);
  for (int j = 0; j < 2; ++j) {
    const SecondColumn& second = seconds[static_cast<std::size_t>(j)];
    expect_only(second, {"time_offset", "droop", "dead_band"});
    expect_size(second, "time_offset", kLag_s);
    expect_size(second, "droop", kDroop * largest_torque(log, j));
    expect_size(second, "dead_band", kBand);
    expect_noise_left(second);
  }
}

// Intervals are those of 95 %.
TEST(SecondColumn, IntervalsHoldTheTruth) {
  constexpr int kLogs = 20;
  int claims = 0;
  int missed = 0;
  for (int seed = 1; seed <= kLogs; ++seed) {
    const JointLog log = simulated({.lag_s = kLag_s,
                                    .droop = kDroop,
                                    .band = kBand,
                                    .rests = seed % 2 == 0,
                                    .seed = static_cast<std::uint64_t>(seed)});
    const std::vector<SecondColumn> seconds = both(log);
    for (int j = 0; j < 2; ++j) {
      for (const TracedEffect& effect : seconds[static_cast<std::size_t>(j)].trace.accepted) {
        const double truth = effect.id.effect == "time_offset" ? kLag_s
                             : effect.id.effect == "dead_band" ? kBand
                                                               : kDroop * largest_torque(log, j);
        ++claims;
        missed += truth < effect.interval.low || truth > effect.interval.high ? 1 : 0;
      }
    }
  }
  EXPECT_EQ(claims, 3 * 2 * kLogs);
  // 6 of 120 are expected; both joints of a log share much.
  EXPECT_LE(missed, 15);
}

TEST(SecondColumn, ALongDelayAndOneTheOtherWay) {
  // Joints that swing once in 1.2 s.
  for (const SecondColumn& second : both(simulated({.lag_s = 0.5, .speed = 4.0}))) {
    expect_only(second, {"time_offset"});
    expect_size(second, "time_offset", 0.5);
  }
  for (const SecondColumn& second : both(simulated({.lag_s = -0.2, .droop = kDroop}))) {
    expect_only(second, {"time_offset", "droop"});
    expect_size(second, "time_offset", -0.2);
    EXPECT_NE(words_of(second).find(" ms behind q"), std::string::npos) << words_of(second);
  }
}

TEST(SecondColumn, AScale) {
  for (const SecondColumn& second : both(simulated({.scale = 0.01}))) {
    expect_only(second, {"encoder_scale"});
    expect_size(second, "encoder_scale", 0.01);
  }
}

TEST(SecondColumn, StepsOfTheOtherColumn) {
  constexpr double kStep = 0.1 * kDegree;
  for (const SecondColumn& second : both(simulated({.lag_s = kLag_s, .step = kStep}))) {
    expect_only(second, {"time_offset", "quantisation"});
    expect_size(second, "quantisation", kStep);
    expect_size(second, "time_offset", kLag_s);
    EXPECT_LT(second.after, 0.1 * kStep);
  }
}

// The markers followed the command: what the encoder says comes late.
TEST(SecondColumn, RolesTheOtherWayRound) {
  KinematicTree tree = arm();
  tree.joints[0].channel = "q1_cmd";
  const JointLog log = simulated({.lag_s = kLag_s, .droop = kDroop, .band = kBand});
  const std::vector<SecondColumn> seconds =
      second_columns(log, with_copies(tree, {{"q1", "q1_cmd"}}), kDown, false);
  ASSERT_EQ(seconds.size(), 1U);
  expect_only(seconds.front(), {"time_offset", "droop", "dead_band"});
  expect_size(seconds.front(), "time_offset", -kLag_s);
  expect_size(seconds.front(), "dead_band", kBand);
  const TracedEffect* band = find_effect(seconds.front(), "dead_band");
  EXPECT_TRUE(band != nullptr && band->id.place == "q1");
  EXPECT_TRUE(seconds.front().lifted);
}

// A spring and a damper: 2 zeta / w late, and 1 / w^2 - (2 zeta / w)^2 / 2 of the acceleration.
TEST(SecondColumn, AServoThatIsASpringAndADamper) {
  constexpr double kBandwidth = 60.0;  // rad/s
  const JointLog log = servo(kBandwidth, 0.25 * kBand, 0.5 * kDroop);
  for (const SecondColumn& second : both(log)) {
    expect_only(second, {"time_offset", "droop", "dead_band", "acceleration_lag"});
    const TracedEffect* offset = find_effect(second, "time_offset");
    const TracedEffect* band = find_effect(second, "dead_band");
    const TracedEffect* lag = find_effect(second, "acceleration_lag");
    if (offset == nullptr || band == nullptr || lag == nullptr) continue;
    EXPECT_NEAR(offset->size, 2.0 / kBandwidth, 0.02 * 2.0 / kBandwidth);
    EXPECT_NEAR(band->size, 0.5 * kBand, 0.03 * 0.5 * kBand);
    EXPECT_LT(lag->size, 0.0);
    EXPECT_LT(second.after, 5.0 * kNoise);
    EXPECT_NE(words_of(second).find("not noise alone"), std::string::npos) << words_of(second);
  }
}

TEST(SecondColumn, NoiseIsNothing) {
  int named = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const SecondColumn& second : both(simulated({.rests = seed % 2 == 0, .seed = seed}))) {
      named += second.trace.accepted.empty() ? 0 : 1;
      EXPECT_NEAR(second.before, kNoise, 0.1 * kNoise);
    }
  }
  // One of a hundred is named by mistake; more than three of 40 in 1 of 1000 runs of this test.
  EXPECT_LE(named, 3);
}

TEST(SecondColumn, EqualColumnsLeaveNothingToSay) {
  JointLog log = simulated({});
  log.values.rightCols(2) = log.values.leftCols(2);
  log.values.col(3).array() += 2.0 * kDegree;
  const std::vector<SecondColumn> seconds = both(log);
  for (const SecondColumn& second : seconds) {
    EXPECT_EQ(second.before, 0.0);
    EXPECT_EQ(second.after, 0.0);
    EXPECT_EQ(second.trace.verdict, TraceVerdict::kClean);
  }
  EXPECT_EQ(words_of(seconds[0]), "q1_cmd is equal to q1");
  EXPECT_EQ(words_of(seconds[1]), "q2_cmd is equal to q2 but for a constant of 2.0°");
}

TEST(SecondColumn, AJointThatDoesNotFollowAtAll) {
  JointLog log = simulated({});
  log.values.col(0).setConstant(0.3);
  log.values.col(3).setConstant(-0.2);
  for (const SecondColumn& second : both(log)) {
    expect_only(second, {});
    EXPECT_TRUE(std::isfinite(second.after));
  }
}

TEST(SecondColumn, ShortLogsSayNothing) {
  for (const double length_s : {0.01, 0.02, 0.5, 1.0}) {
    for (const SecondColumn& second : both(simulated({.lag_s = kLag_s, .length_s = length_s}))) {
      expect_only(second, {});
      EXPECT_TRUE(std::isfinite(second.before));
    }
  }
  EXPECT_TRUE(both(JointLog{}).empty());
}

TEST(SecondColumn, AGapInTheLog) {
  JointLog log = simulated({.lag_s = kLag_s});
  for (std::size_t i = log.size() / 2; i < log.size(); ++i) log.times_s[i] += 30.0;
  for (const SecondColumn& second : both(log)) {
    expect_only(second, {"time_offset"});
    expect_size(second, "time_offset", kLag_s);
    expect_noise_left(second);
  }
}

TEST(SecondColumn, PosturesHaveNoTime) {
  JointLog log = simulated({.droop = kDroop, .scale = 0.01});
  std::vector<Eigen::Index> rows;
  log.times_s.clear();
  for (Eigen::Index i = 0; i < log.values.rows(); i += 25) {
    log.times_s.push_back(static_cast<double>(rows.size()));
    rows.push_back(i);
  }
  log.values = log.values(rows, Eigen::all).eval();
  const std::vector<SecondColumn> seconds =
      second_columns(log, with_copies(arm(), {{"q2_cmd", "q2"}}), kDown, true);
  ASSERT_EQ(seconds.size(), 1U);
  expect_only(seconds.front(), {"droop", "encoder_scale"});
  // Of the command, which says more of the droop, too.
  expect_size(seconds.front(), "droop", 1.01 * kDroop * largest_torque(log, 1));
  expect_size(seconds.front(), "encoder_scale", 0.01);
  for (const TestedCandidate& tested : seconds.front().trace.candidates) {
    EXPECT_NE(tested.id.effect, "time_offset");
    EXPECT_NE(tested.id.effect, "dead_band");
  }
  EXPECT_EQ(words_of(seconds.front()).find("noise"), std::string::npos);
}

// Ticks, a joint that another one's channel moves, too, and a slide.
TEST(SecondColumn, SizesAreOfTheJointsValue) {
  constexpr double kTick = 1e-3;
  KinematicTree tree = arm();
  JointLog log = simulated({.lag_s = kLag_s, .band = kBand});
  tree.joints[1].scale = kTick;
  tree.joints[1].offset = 0.4;
  tree.joints[1].couplings = {{"q1", 200.0}};
  for (const int own : {1, 3}) {
    log.values.col(own).array() -= 0.4;
    log.values.col(own) /= kTick;
    log.values.col(own) -= 200.0 * log.values.col(0);
  }
  const std::vector<SecondColumn> turns =
      second_columns(log, with_copies(tree, {{"q2_cmd", "q2"}}), kDown, false);
  ASSERT_EQ(turns.size(), 1U);
  expect_size(turns.front(), "dead_band", kBand);
  tree = arm();
  tree.joints[1].type = JointType::kPrismatic;
  const std::vector<SecondColumn> slides =
      second_columns(log, with_copies(tree, {{"q2_cmd", "q2"}}), kDown, false);
  ASSERT_EQ(slides.size(), 1U);
  EXPECT_EQ(slides.front().unit, "m");
  EXPECT_NE(words_of(slides.front()).find(" mm, is "), std::string::npos);
}

TEST(SecondColumn, ColumnsThatAreNotThereArePassedOver) {
  const JointLog log = simulated({.length_s = 2.0});
  KinematicTree other = arm();
  other.joints[1].channel = "q3";
  EXPECT_TRUE(
      second_columns(log, with_copies(other, {{"q3_cmd", "q1"}, {"q1_cmd", "q3"}}), kDown, false)
          .empty());
}

TEST(SecondColumn, WordsSayWhoIsBehindWhomAndByHowMuch) {
  SecondColumn second{.column = "q1_cmd", .channel = "q1", .joint = "joint1", .unit = "rad"};
  second.before = 2.0 * kDegree;
  second.after = 0.02 * kDegree;
  second.noise = 0.019 * kDegree;
  second.trace.verdict = TraceVerdict::kEffects;
  const auto add = [&](const std::string& name, double size, double half, const std::string& unit) {
    TracedEffect effect;
    effect.id = {name, "joint1"};
    effect.size = size;
    effect.unit = unit;
    effect.interval = {size - half, size + half};
    second.trace.accepted.push_back(effect);
  };
  add("droop", 1.9 * kDegree, 0.15 * kDegree, "rad");
  add("time_offset", 0.06, 0.0012, "s");
  add("encoder_scale", -0.01, 0.001, "");
  EXPECT_EQ(
      words_of(second),
      "q1_cmd is 60.0 (58.8 to 61.2) ms ahead of q1, says 1.00 (0.90 to 1.10) % less than q1; "
      "q1 stays behind q1_cmd by up to 1.90 (1.75 to 2.05)° under load; what is left, "
      "0.020°, is noise");
}

}  // namespace
}  // namespace kinescope
