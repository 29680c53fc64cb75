// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/one_clock.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr double kRounding_s = 1e-9;

TEST(OneClock, RestartedClocksLieBehindEachOther) {
  const Eigen::VectorXd t_s{{5.0, 5.1, 5.2, 5.0, 5.1, 5.2, 9.0, 9.1}};
  const Eigen::VectorXi trajectory{{0, 0, 0, 1, 1, 1, 2, 2}};
  const OneClock clock(t_s, trajectory, {.gap_s = 0.7, .gap_steps = 4.0});
  EXPECT_TRUE(clock.moved());
  // The second begins 0.7 s after the first; the third is late enough to keep its own clock.
  const Eigen::VectorXd expected{{5.0, 5.1, 5.2, 5.9, 6.0, 6.1, 9.0, 9.1}};
  EXPECT_LT((clock.time_s() - expected).cwiseAbs().maxCoeff(), kRounding_s);
  for (Eigen::Index row = 0; row < t_s.size(); ++row) {
    const LogMoment moment = clock.moment(clock.time_s()[row]);
    EXPECT_EQ(moment.trajectory, trajectory[row]);
    EXPECT_NEAR(moment.t_s, t_s[row], kRounding_s);
  }
  EXPECT_EQ(clock.moment(6.3).trajectory, 1);
}

TEST(OneClock, OneThatGoesOnIsKept) {
  const Eigen::VectorXd t_s{{1.0, 1.1, 1.2, 1.3}};
  const Eigen::VectorXi trajectory{{3, 3, 4, 4}};
  EXPECT_FALSE(OneClock(t_s, trajectory).moved());
  // Where a gap is asked for, none may be smaller.
  const OneClock apart(t_s, trajectory, {.least_gap_s = 0.5, .gap_s = 1.0, .gap_steps = 1.0});
  EXPECT_NEAR(apart.begins_s()[1], 2.1, kRounding_s);
  EXPECT_NEAR(apart.moment(2.2).t_s, 1.3, kRounding_s);
  EXPECT_EQ(apart.moment(2.2).trajectory, 4);
}

}  // namespace
}  // namespace kinescope
