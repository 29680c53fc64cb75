// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tone_table.h"

#include <cmath>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr double kDark = 35.0;
constexpr double kBright = 210.0;

// The share of grey between the levels.
double grey(double share, double gamma) {
  const double low = std::pow(kDark / 255.0, gamma);
  const double high = std::pow(kBright / 255.0, gamma);
  const double light = 255.0 * std::pow(low + (high - low) * share, 1.0 / gamma);
  return (light - kDark) / (kBright - kDark);
}

TEST(ToneTable, IsTheCurveAndItsSlopes) {
  constexpr double kClose = 2e-3;  // of the contrast
  constexpr double kStep = 1e-4;
  for (const double gamma : {1.0, 1.6, 2.2}) {
    const ToneTable table(kDark, kBright, gamma);
    for (int i = 0; i <= 20; ++i) {
      const double share = 0.05 * i;
      const ToneTable::Value seen = table.at(share);
      EXPECT_NEAR(seen.value, grey(share, gamma), kClose) << gamma << " " << share;
      EXPECT_NEAR(seen.per_gamma, (grey(share, gamma + kStep) - grey(share, gamma)) / kStep, kClose)
          << gamma << " " << share;
      // Of the table's own pieces, each 1/64 long.
      const double from = std::floor(64.0 * share) / 64.0;
      EXPECT_NEAR(seen.slope, 64.0 * (grey(from + 1.0 / 64.0, gamma) - grey(from, gamma)), kClose)
          << gamma << " " << share;
    }
  }
}

TEST(ToneTable, SharesFarOutAreThoseOfItsEnds) {
  const ToneTable table(kDark, kBright, 2.2);
  EXPECT_TRUE(std::isfinite(table.at(-5.0).value));
  EXPECT_TRUE(std::isfinite(table.at(5.0).value));
  EXPECT_LT(table.at(-0.2).value, 0.0);
  EXPECT_GT(table.at(1.2).value, 1.0);
}

}  // namespace
}  // namespace kinescope
