// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/lasting_body.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope::trace {
namespace {

constexpr int kManyInstants = 400;
constexpr int kSeenBodies = 5;
constexpr int kRowsOfOne = 8;
constexpr double kLeast = 1.2;
constexpr double kPxOfNoise = 0.1;

// White noise, of the last body as often as large; and a slow wave of that one.
Linearisation slow_body(double wave, double noise = 1.0) {
  Rng rng(3);
  Linearisation out;
  out.residual.resize(kManyInstants * kSeenBodies * kRowsOfOne);
  out.unit = Eigen::VectorXd::Constant(out.residual.size(), kPxOfNoise);
  out.coordinates = 2;
  out.time_s = Eigen::VectorXd::LinSpaced(kManyInstants, 0.0, 13.0);
  int row = 0;
  for (int i = 0; i < kManyInstants; ++i) {
    out.first_row.push_back(row);
    for (int b = 0; b < kSeenBodies; ++b) {
      const bool last = b == kSeenBodies - 1;
      const double slow = last ? wave * std::sin(0.05 * i) : 0.0;
      for (int k = 0; k < kRowsOfOne; ++k) {
        out.residual[row++] = rng.normal(last ? noise : 1.0) + slow;
        out.body.push_back(b);
      }
    }
  }
  out.first_row.push_back(row);
  return out;
}

std::optional<LastingBody> lasting(const Linearisation& of) {
  return find_lasting_body(of, static_cast<double>(of.residual.size()), kLeast);
}

TEST(LastingBody, IsTheOneThatMovesSlowly) {
  constexpr double kWave = 2.0;
  const Linearisation slow = slow_body(kWave);
  // Beside the others it does not show: less than kLeast in all.
  EXPECT_LT(std::sqrt(slow.residual.squaredNorm() / static_cast<double>(slow.residual.size())),
            kLeast);
  const auto found = lasting(slow);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->body, kSeenBodies - 1);
  const double expected = std::sqrt(1.0 + 0.5 * kWave * kWave);
  EXPECT_NEAR(found->over_differences, expected, 0.05 * expected);
  EXPECT_NEAR(found->over_noise, expected, 0.05 * expected);
  EXPECT_NEAR(found->rms, std::sqrt(2.0) * kPxOfNoise * expected, 0.05 * kPxOfNoise * expected);
}

TEST(LastingBody, IsNoneThatOnlyScatters) {
  EXPECT_FALSE(lasting(slow_body(0.0)));
  EXPECT_FALSE(lasting(slow_body(0.0, 2.0)));
}

TEST(LastingBody, IsNoneAtPosturesOrOfRowsThatAreOfNoBody) {
  Linearisation slow = slow_body(2.0);
  slow.independent_instants = true;
  EXPECT_FALSE(lasting(slow));
  slow.independent_instants = false;
  slow.body.clear();
  EXPECT_FALSE(lasting(slow));
}

}  // namespace
}  // namespace kinescope::trace
