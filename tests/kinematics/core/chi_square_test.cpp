// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/chi_square.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

// From tables, to the formula's three per cent.
TEST(ChiSquare, QuantilesAndTails) {
  EXPECT_NEAR(chi_square_quantile(1, 3.0902), 10.83, 0.35);
  EXPECT_NEAR(chi_square_quantile(6, 3.0902), 22.46, 0.35);
  EXPECT_NEAR(chi_square_quantile(2, 0.0), 1.386, 0.02);
  EXPECT_EQ(chi_square_quantile(1, -10.0), 0.0);
  EXPECT_NEAR(chi_square_tail(5.348, 6.0), 0.5, 0.01);
  EXPECT_NEAR(chi_square_tail(12.59, 6.0), 0.05, 0.002);
}

TEST(ChiSquare, TheTailOfAQuantileIsTheNormalTail) {
  for (const double freedom : {0.7, 2.0, 8.0, 100.0}) {
    for (const double z : {-0.5, 0.0, 1.0, 3.0}) {
      EXPECT_NEAR(chi_square_tail(chi_square_quantile(freedom, z), freedom),
                  0.5 * std::erfc(z / std::numbers::sqrt2), 1e-12);
    }
  }
}

}  // namespace
}  // namespace kinescope
