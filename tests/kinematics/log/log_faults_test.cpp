// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/log_faults.h"

#include <cmath>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr double kStepS = 0.01;

// Two joints in motion for 10 s.
JointLog moving() {
  JointLog log;
  log.channels = {"a", "b"};
  log.values.resize(1000, 2);
  for (Eigen::Index i = 0; i < log.values.rows(); ++i) {
    const double t = kStepS * static_cast<double>(i);
    log.times_s.push_back(t);
    log.values.row(i) << std::sin(t), 0.3 * std::cos(2.0 * t);
  }
  return log;
}

JointLog without_rows(const JointLog& log, std::size_t from, std::size_t to) {
  JointLog out = log;
  out.times_s.erase(out.times_s.begin() + static_cast<std::ptrdiff_t>(from),
                    out.times_s.begin() + static_cast<std::ptrdiff_t>(to));
  std::vector<Eigen::Index> kept;
  for (std::size_t i = 0; i < log.size(); ++i) {
    if (i < from || i >= to) kept.push_back(static_cast<Eigen::Index>(i));
  }
  out.values = log.values(kept, Eigen::all).eval();
  return out;
}

TEST(RepeatedStretches, AreFoundFromFirstToLastRow) {
  JointLog log = moving();
  EXPECT_TRUE(repeated_stretches(log, 0.05).empty());
  for (Eigen::Index i = 301; i < 500; ++i) log.values.row(i) = log.values.row(300);
  const auto found = repeated_stretches(log, 1.0);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_DOUBLE_EQ(found[0].from_s, log.times_s[300]);
  EXPECT_DOUBLE_EQ(found[0].to_s, log.times_s[499]);
  const JointLog without = without_stretches(log, found);
  EXPECT_EQ(without.size(), log.size() - 198);
  EXPECT_EQ(without.times_s[301], log.times_s[499]);
  EXPECT_EQ(without.values.row(302), log.values.row(500));
  EXPECT_TRUE(repeated_stretches(log, 2.0).empty()) << "shorter than asked for";
  log.values(400, 1) += 1e-9;
  EXPECT_TRUE(repeated_stretches(log, 1.5).empty()) << "one channel that changes is a change";
}

TEST(RepeatedStretches, ALogThatNeverChangesHasNone) {
  JointLog log = moving();
  log.values.setOnes();
  EXPECT_TRUE(repeated_stretches(log, 1.0).empty());
}

TEST(ClockJumps, AreGapsOfTimeOnly) {
  JointLog log = moving();
  EXPECT_TRUE(clock_jumps(log).empty());
  for (std::size_t i = 500; i < log.size(); ++i) log.times_s[i] += 2.0;
  const auto found = clock_jumps(log);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_DOUBLE_EQ(found[0].after_s, log.times_s[499]);
  EXPECT_NEAR(found[0].by_s, 2.0, 1e-9);
}

// At its turning point a joint's speed is nothing beside its noise.
TEST(ClockJumps, AreSeenBesideNoise) {
  JointLog log = moving();
  for (Eigen::Index i = 0; i < log.values.rows(); ++i) {
    log.values(i, 1) = 0.3 * std::cos(0.01 * static_cast<double>(i - 499)) +
                       (i % 2 == 0 ? 2e-4 : -2e-4) * (i % 3 == 0 ? 2.0 : 1.0);
  }
  for (std::size_t i = 500; i < log.size(); ++i) log.times_s[i] += 2.0;
  const auto found = clock_jumps(log);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_DOUBLE_EQ(found[0].after_s, log.times_s[499]);
}

TEST(ClockJumps, MissedReadingsAreNone) {
  EXPECT_TRUE(clock_jumps(without_rows(moving(), 400, 600)).empty());
}

TEST(ClockJumps, APauseIsNone) {
  JointLog log = moving();
  for (Eigen::Index i = 480; i < log.values.rows(); ++i) log.values.row(i) = log.values.row(480);
  EXPECT_TRUE(clock_jumps(without_rows(log, 500, 800)).empty());
}

}  // namespace
}  // namespace kinescope
