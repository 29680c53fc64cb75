// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/readings_apart.h"

#include <cmath>
#include <set>
#include <utility>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

JointLog waves(int rows) {
  JointLog log;
  log.channels = {"a", "b"};
  log.values.resize(rows, 2);
  for (int i = 0; i < rows; ++i) {
    log.times_s.push_back(0.1 * i);
    log.values.row(i) << std::sin(0.3 * i), 5.0 * std::cos(0.2 * i);
  }
  return log;
}

JointLog fine_waves() {
  JointLog log;
  log.source = "log";
  log.time_column = "t";
  log.channels = {"a", "b", "c"};
  log.values.resize(500, 3);
  for (int i = 0; i < 500; ++i) {
    const double t = 0.01 * i;
    log.times_s.push_back(t);
    log.values.row(i) << std::sin(3.0 * t), std::cos(2.0 * t), std::sin(1.0 + 2.5 * t);
  }
  return log;
}

TEST(ReadingsApart, AMotionHasNone) { EXPECT_TRUE(readings_apart(waves(50)).empty()); }

TEST(ReadingsApart, AreThoseThatMakeHalfTheRangeAlone) {
  JointLog log = waves(50);
  log.values(20, 0) = 17.5;
  log.values(7, 1) = -300.0;
  log.values(8, 1) = 40.0;  // beside the one above, hardly beyond the others; without it far
  const std::vector<ReadingApart> apart = readings_apart(log);
  ASSERT_EQ(apart.size(), 3U);
  EXPECT_EQ(apart[0].row, 7U);
  EXPECT_EQ(apart[1].row, 8U);
  EXPECT_EQ(apart[2].row, 20U);
  EXPECT_EQ(apart[2].channel, 0);
}

// 0.2 in a range of 2, where the largest step is 0.03.
TEST(ReadingsApart, AreThoseWhereNoMotionLeadsFromTheirNeighbours) {
  JointLog log = fine_waves();
  for (const auto& [row, by] : {std::pair{40, 0.2}, {41, -0.15}, {300, -0.2}})
    log.values(row, 0) += by;
  const std::vector<ReadingApart> apart = readings_apart(log);
  ASSERT_EQ(apart.size(), 3U);
  EXPECT_EQ(apart[0].row, 40U);
  EXPECT_EQ(apart[1].row, 41U);
  EXPECT_EQ(apart[2].row, 300U);
  for (const ReadingApart& reading : apart) {
    EXPECT_EQ(reading.channel, 0);
    EXPECT_TRUE(reading.in_range);
  }
  EXPECT_EQ(
      words_of(log, {&apart[2], 1}),
      "log: at t = 3 'a' reads 0.212118, which the readings before and after do not come near");
}

TEST(ReadingsApart, RowsThatAreWrongAreSoInAllTheirChannels) {
  JointLog log = fine_waves();
  const JointLog truth = log;
  Rng rng = Rng::from_name("readings apart", 1);
  std::set<std::size_t> wrong;
  while (wrong.size() < 25) {
    const int row = rng.index(static_cast<int>(log.size()));
    wrong.insert(static_cast<std::size_t>(row));
    for (int c = 0; c < log.values.cols(); ++c) log.values(row, c) = rng.uniform(-1.0, 1.0);
  }
  const std::vector<ReadingApart> apart = readings_apart(log);
  EXPECT_EQ(apart.size(), 3 * wrong.size());
  for (const ReadingApart& reading : apart) EXPECT_TRUE(wrong.contains(reading.row));
  EXPECT_EQ(told_together(apart).size(), 3U);
  const JointLog mended = without_readings(log, apart);
  EXPECT_LT((mended.values - truth.values).cwiseAbs().maxCoeff(), 0.02);
}

// A step, a stop, flicker of the last digit, postures.
TEST(ReadingsApart, AreNoneOfWhatLogsHoldBesideAMotion) {
  JointLog log = fine_waves();
  log.values.col(0).tail(200).array() += 3.0;
  log.values.col(1).segment(100, 50).setConstant(log.values(100, 1));
  log.values.col(2) = (log.values.col(2) / 0.01).array().round() * 0.01;
  EXPECT_TRUE(readings_apart(log).empty());
  Rng rng = Rng::from_name("readings apart", 2);
  for (double& value : log.values.reshaped()) value = rng.uniform(-1.0, 1.0);
  EXPECT_TRUE(readings_apart(log).empty());
}

TEST(ReadingsApart, WhatLiesBetweenTheirNeighboursTakesTheirPlace) {
  JointLog log = waves(50);
  const JointLog truth = log;
  log.values(20, 0) = 17.5;
  log.values(0, 1) = 900.0;
  const JointLog mended = without_readings(log, readings_apart(log));
  EXPECT_NEAR(mended.values(20, 0), 0.5 * (truth.values(19, 0) + truth.values(21, 0)), 1e-12);
  EXPECT_NEAR(mended.values(0, 1), truth.values(1, 1), 1e-12);  // nothing before it
  EXPECT_EQ(mended.values(20, 1), truth.values(20, 1));
  EXPECT_EQ(mended.times_s, truth.times_s);
}

TEST(ReadingsApart, OfAConstantOrAShortLogNothingIsSaid) {
  JointLog log = waves(50);
  log.values.col(0).setConstant(3.0);
  EXPECT_TRUE(readings_apart(log).empty());
  log = waves(5);
  log.values(2, 0) = 100.0;
  EXPECT_TRUE(readings_apart(log).empty());
  EXPECT_TRUE(readings_apart(JointLog{}).empty());
}

}  // namespace
}  // namespace kinescope
