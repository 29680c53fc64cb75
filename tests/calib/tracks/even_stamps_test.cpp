// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/even_stamps.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kPeriod_s = 1.0 / 29.97;

std::vector<double> even_times(int frames) {
  std::vector<double> out;
  for (int k = 0; k < frames; ++k) out.push_back(4.0 + kPeriod_s * k);
  return out;
}

// The most that differences to the exact times differ from each other.
double unevenness(const std::vector<double>& times_s, const std::vector<double>& exact_s) {
  std::vector<double> differences;
  for (std::size_t i = 0; i < times_s.size(); ++i) differences.push_back(times_s[i] - exact_s[i]);
  const auto [low, high] = std::ranges::minmax(differences);
  return high - low;
}

TEST(EvenStamps, JitterAndMissingFramesAreToldApart) {
  Rng rng(3);
  std::vector<double> exact;
  std::vector<double> stamps;
  for (const double t : even_times(900)) {
    if (rng.uniform() < 0.1) continue;
    exact.push_back(t);
    stamps.push_back(t + rng.normal(0.004));
  }
  const auto even = even_stamps(stamps);
  ASSERT_TRUE(even);
  EXPECT_NEAR(even->scatter_s, 0.004, 0.0005);
  EXPECT_NEAR(even->rate_hz, 29.97, 0.002);
  EXPECT_LT(unevenness(even->times_s, exact), 0.003);
}

TEST(EvenStamps, FramesThatArriveTogetherAreOfThePeriodsBefore) {
  const std::vector<double> exact = even_times(600);
  std::vector<double> stamps = exact;
  for (std::size_t first = 40; first + 6 < stamps.size(); first += 60) {
    for (std::size_t k = 0; k < 6; ++k)
      stamps[first + k] = exact[first + 5] + 5e-4 * static_cast<double>(k);
  }
  const auto even = even_stamps(stamps);
  ASSERT_TRUE(even);
  EXPECT_LT(unevenness(even->times_s, exact), 0.003);
  EXPECT_TRUE(std::ranges::is_sorted(even->times_s));
}

// An hour: the rate of the first seconds is followed to the end.
TEST(EvenStamps, ALongRecordingIsEvenToItsEnd) {
  Rng rng(4);
  const std::vector<double> exact = even_times(108'000);
  std::vector<double> stamps = exact;
  for (double& t : stamps) t += rng.uniform(0.0, 0.02);
  const auto even = even_stamps(stamps);
  ASSERT_TRUE(even);
  EXPECT_LT(unevenness(even->times_s, exact), 0.003);
}

TEST(EvenStamps, NothingIsMadeOfStampsThatAreEvenOrNoCameras) {
  EXPECT_FALSE(even_stamps(even_times(600)));
  std::vector<double> thinned = even_times(600);
  thinned.erase(thinned.begin() + 100, thinned.begin() + 130);
  EXPECT_FALSE(even_stamps(thinned));
  EXPECT_FALSE(even_stamps(even_times(20)));
  Rng rng(1);
  std::vector<double> paused;
  for (const double t : even_times(200))
    paused.push_back(t + rng.normal(0.004) + (paused.size() < 100 ? 0.0 : 60.0));
  EXPECT_FALSE(even_stamps(paused));
}

}  // namespace
}  // namespace kinescope
