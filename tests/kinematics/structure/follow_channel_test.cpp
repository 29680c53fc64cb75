// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/follow_channel.h"

#include <cmath>

#include <gtest/gtest.h>

namespace kinescope::structure_search {
namespace {

// A joint that moves by the difference of two channels that go together a little follows neither of
// them by half.
TEST(FollowChannel, ADifferenceOfTwoIsDrivenByBoth) {
  constexpr int kReadings = 100;
  constexpr double kTogether = 0.3;
  constexpr double kScale = 0.4;
  Readings readings;
  readings.value.resize(kReadings, 3);
  readings.mean = {0.0, 0.0, 0.0};
  readings.rms = {1.0, 1.0, 1.0};
  ChainModel free;
  free.joints.resize(1);
  free.joints.front().type = JointType::kRevolute;
  Motion motion;
  for (int i = 0; i < kReadings; ++i) {
    const double phase = 2.0 * M_PI * i / kReadings;
    const double first = std::sin(phase);
    const double second =
        kTogether * first + std::sqrt(1.0 - kTogether * kTogether) * std::cos(phase);
    readings.value.row(i) << first, std::sin(3.0 * phase), second;
    free.coordinates.push_back(kScale * (first - second) + 0.1);
    motion.emplace_back().instant = i;
  }
  const auto driven = driven_by_best_channel(free, motion, readings, {1, 1, 1});
  ASSERT_TRUE(driven);
  const std::vector<ChainTerm>& terms = driven->start.joints.front().terms;
  ASSERT_EQ(terms.size(), 2U);
  for (const ChainTerm& term : terms) {
    EXPECT_NE(term.channel, 1);
    EXPECT_NEAR(term.scale, term.channel == 0 ? kScale : -kScale, 1e-9);
  }
  EXPECT_FALSE(driven_by_best_channel(free, motion, readings, {1, 1, 0}));
}

}  // namespace
}  // namespace kinescope::structure_search
