// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/pose_log.h"

#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

Pose on_a_curve(double t) {
  return {exp_rotation({0.5 * std::sin(t), 0.3 * std::cos(2.0 * t), 0.7 * t}),
          {std::cos(t), std::sin(t), 0.2 * t}};
}

PoseLog curve(double rate_hz) {
  PoseLog out;
  for (int k = 0; k <= static_cast<int>(4.0 * rate_hz); ++k) {
    out.times_s.push_back(k / rate_hz);
    out.poses.push_back(on_a_curve(out.times_s.back()));
  }
  return out;
}

double worst_error(double rate_hz) {
  const PoseLog log = curve(rate_hz);
  double worst = 0.0;
  for (double t = 0.5; t < 3.5; t += 0.0137) {
    const auto at = pose_at(log, t);
    EXPECT_TRUE(at.has_value());
    worst = std::max(worst, log_pose(at->pose.inverse() * on_a_curve(t)).norm());
  }
  return worst;
}

TEST(PoseLog, InterpolationIsOfThirdOrder) {
  EXPECT_LT(worst_error(100.0), 1e-6);
  // Eight times finer for twice the rows, at least.
  EXPECT_LT(worst_error(40.0), worst_error(20.0) / 6.0);
}

TEST(PoseLog, TheTwistIsTheRate) {
  const PoseLog log = curve(100.0);
  constexpr double kStep = 1e-4;
  for (const double t : {0.4321, 1.2345, 2.6789}) {
    const auto at = pose_at(log, t);
    const auto next = pose_at(log, t + kStep);
    ASSERT_TRUE(at && next);
    const Vector6d rate = log_pose(at->pose.inverse() * next->pose) / kStep;
    EXPECT_LT((rate - at->twist).norm(), 1e-3);
  }
}

TEST(PoseLog, NothingOutsideAndInGaps) {
  PoseLog log = curve(10.0);
  EXPECT_FALSE(pose_at(log, -0.01));
  EXPECT_FALSE(pose_at(log, 4.01));
  EXPECT_TRUE(pose_at(log, 4.0));
  log.times_s.erase(log.times_s.begin() + 11, log.times_s.begin() + 19);
  log.poses.erase(log.poses.begin() + 11, log.poses.begin() + 19);
  EXPECT_FALSE(pose_at(log, 1.5));
  EXPECT_TRUE(pose_at(log, 1.0));
}

TEST(PoseLog, ANumberedLogHasItsRowsAlone) {
  PoseLog log = curve(10.0);
  log.numbered = true;
  EXPECT_FALSE(pose_at(log, 1.05));
  ASSERT_TRUE(pose_at(log, 1.0));
  EXPECT_EQ(pose_at(log, 1.0)->twist, Vector6d(Vector6d::Zero()));
}

TEST(PoseLog, RowsAreMovedBesideTheirTimes) {
  PoseLog log = curve(10.0);
  log.lines.resize(log.poses.size());
  std::iota(log.lines.begin(), log.lines.end(), std::size_t{2});
  const PoseLog later = with_rows_moved(log, 1);
  ASSERT_EQ(later.times_s.size(), log.times_s.size() - 1);
  EXPECT_EQ(later.times_s.front(), log.times_s.front());
  EXPECT_EQ(later.poses.front().matrix4(), log.poses[1].matrix4());
  EXPECT_EQ(later.lines.front(), 3U);
  const PoseLog earlier = with_rows_moved(log, -1);
  EXPECT_EQ(earlier.times_s.front(), log.times_s[1]);
  EXPECT_EQ(earlier.poses.front().matrix4(), log.poses.front().matrix4());
  EXPECT_EQ(earlier.lines.back(), log.lines[log.lines.size() - 2]);
  EXPECT_TRUE(with_rows_moved(log, 1000).poses.empty());
  log.numbered = true;
  EXPECT_EQ(with_rows_moved(log, 1).times_s.front(), log.times_s.front() - 1.0);
}

}  // namespace
}  // namespace kinescope
