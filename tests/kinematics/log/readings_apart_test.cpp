// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/readings_apart.h"

#include <cmath>

#include <gtest/gtest.h>

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
