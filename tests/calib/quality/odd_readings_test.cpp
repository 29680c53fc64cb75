// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/odd_readings.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr double kStep_s = 0.1;
constexpr double kOffset_s = 0.25;

// Of a film whose clock is behind the log's.
Calibration film() {
  Calibration out;
  for (int frame = 0; frame < 100; ++frame) out.times_s.push_back(kStep_s * frame);
  out.time_offset_s = kOffset_s;
  return out;
}

OddReading odd(int frame, const std::string& channel, double read, double expected) {
  return {kStep_s * frame, channel, read, expected};
}

TEST(OddStretches, AFrozenReadingIsOneWithAFrameBetween) {
  // In frame 22 the joint comes by what it reads.
  const std::vector<OddStretch> found =
      odd_stretches(film(), {odd(20, "q1", 0.5, 0.3), odd(21, "q1", 0.5, 0.4),
                             odd(23, "q1", 0.5, 0.9), odd(24, "q1", 0.5, 0.8)});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].channel, "q1");
  EXPECT_EQ(found[0].frames, 4);
  EXPECT_TRUE(found[0].stands_still);
  EXPECT_DOUBLE_EQ(found[0].from_s, 20 * kStep_s + kOffset_s);
  EXPECT_DOUBLE_EQ(found[0].to_s, 24 * kStep_s + kOffset_s);
  EXPECT_EQ(found[0].most.expected, 0.9);
}

TEST(OddStretches, ChannelsAndStretchesAreApartAndASingleFrameIsNone) {
  const std::vector<OddStretch> found = odd_stretches(
      film(), {odd(5, "q2", 0.1, 0.2), odd(30, "q2", 0.1, 0.2), odd(31, "q1", 1.0, 2.0),
               odd(31, "q2", 0.15, 0.2), odd(32, "q1", 1.0, 2.0), odd(60, "q1", 1.0, 0.0),
               odd(61, "q1", 1.1, 0.0)});
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].channel, "q2");
  EXPECT_FALSE(found[0].stands_still);
  EXPECT_EQ(found[1].channel, "q1");
  EXPECT_TRUE(found[1].stands_still);
  EXPECT_DOUBLE_EQ(found[2].from_s, 60 * kStep_s + kOffset_s);
  EXPECT_FALSE(found[2].stands_still);
  EXPECT_EQ(found[2].most.read, 1.1);
  EXPECT_TRUE(odd_stretches(film(), {}).empty());
}

}  // namespace
}  // namespace kinescope
