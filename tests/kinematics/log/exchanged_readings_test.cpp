// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/exchanged_readings.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

JointLog waves() {
  JointLog log;
  log.source = "joints.csv";
  log.channels = {"a", "b", "c"};
  log.values.resize(500, 3);
  for (int i = 0; i < 500; ++i) {
    const double t = 0.01 * i;
    log.times_s.push_back(t);
    log.values.row(i) << std::sin(3.0 * t), 1.5 * std::cos(2.0 * t), 0.3 + std::sin(1.0 + 2.5 * t);
  }
  return log;
}

JointLog exchanged_from(JointLog log, Eigen::Index row, int one, int other) {
  const Eigen::Index count = log.values.rows() - row;
  const Eigen::VectorXd before = log.values.col(one).tail(count);
  log.values.col(one).tail(count) = log.values.col(other).tail(count);
  log.values.col(other).tail(count) = before;
  return log;
}

std::vector<ExchangedReadings> exchanged_in(const JointLog& log) {
  return exchanged_readings(log, readings_apart(log));
}

void expect_mended(const JointLog& damaged, std::size_t instants) {
  const auto found = exchanged_in(damaged);
  EXPECT_EQ(found.size(), instants);
  EXPECT_EQ(with_exchanged_back(damaged, found).values, waves().values);
}

TEST(ExchangedReadings, AMotionHasNone) { EXPECT_TRUE(exchanged_in(waves()).empty()); }

TEST(ExchangedReadings, AreColumnsThatJumpIntoEachOthersPlace) {
  const JointLog log = exchanged_from(waves(), 230, 0, 1);
  expect_mended(log, 1);
  EXPECT_EQ(words_of(log, exchanged_in(log).front()),
            "joints.csv: from t = 2.3 on 'a' goes on as 'b', 'b' goes on as 'a'");
}

TEST(ExchangedReadings, MayBeOfThree) {
  expect_mended(exchanged_from(exchanged_from(waves(), 230, 0, 1), 230, 1, 2), 1);
}

TEST(ExchangedReadings, MayEndAgain) {
  expect_mended(exchanged_from(exchanged_from(waves(), 100, 0, 2), 400, 0, 2), 2);
}

TEST(ExchangedReadings, AreOneThatTurnsItsSign) {
  JointLog log = waves();
  log.values.col(1).tail(300) *= -1.0;
  expect_mended(log, 1);
  EXPECT_EQ(words_of(log, exchanged_in(log).front()),
            "joints.csv: from t = 2 on 'b' goes on as -'b'");
}

// Each posture is a jump.
TEST(ExchangedReadings, AreNoneOfPosturesInARow) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    JointLog log = waves();
    log.values.conservativeResize(90, Eigen::NoChange);
    log.times_s.resize(90);
    for (double& value : log.values.reshaped()) value = rng.uniform(-1.5, 1.5);
    EXPECT_TRUE(exchanged_in(log).empty()) << seed;
  }
}

// A gripper that closes, an encoder that loses count, a gap in the log.
TEST(ExchangedReadings, AreNoJumpElsewhere) {
  JointLog log = waves();
  log.values.col(0).tail(200).array() += 0.4;
  log.values.col(2).setConstant(-1.0);
  log.values.col(2).tail(200).setConstant(1.0);
  EXPECT_TRUE(exchanged_in(log).empty());
  JointLog gap = waves();
  gap.times_s.erase(gap.times_s.begin() + 100, gap.times_s.begin() + 170);
  const Eigen::MatrixXd behind = gap.values.bottomRows(330);
  gap.values.conservativeResize(430, Eigen::NoChange);
  gap.values.bottomRows(330) = behind;
  EXPECT_TRUE(exchanged_in(gap).empty());
}

// Behind a reading of 0 the motion seems to come from the other side.
TEST(ExchangedReadings, AreNoneBehindASingleWrongReading) {
  JointLog log = waves();
  for (const int row : {130, 301}) log.values(row, 0) = 0.0;
  log.values.row(222).setZero();
  EXPECT_TRUE(exchanged_in(log).empty());
}

// Between episodes the robot was elsewhere.
TEST(ExchangedReadings, AreNotLookedForBetweenEpisodes) {
  JointLog log = exchanged_from(waves(), 230, 0, 1);
  log.joined_at_s = {log.times_s[230]};
  EXPECT_TRUE(exchanged_in(log).empty());
}

}  // namespace
}  // namespace kinescope
