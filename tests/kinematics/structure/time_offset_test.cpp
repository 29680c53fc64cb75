// SPDX-License-Identifier: Apache-2.0
//
// The clock offset from the structure search. tests/experiments/structure_lag has many more cases.
#include <cmath>

#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

struct OffsetCase {
  const char* name;
  double lag_s;
  double prismatic_share;
  double lowest_hz;
  double highest_hz;
  double corner_px;
  double flip_share;
};

class ClockOffset : public testing::TestWithParam<OffsetCase> {};

TEST_P(ClockOffset, IsFoundToMilliseconds) {
  const OffsetCase& c = GetParam();
  RecordingOptions o = noisy();
  o.frames = 360;
  o.lag_s = c.lag_s;
  o.lowest_hz = c.lowest_hz;
  o.highest_hz = c.highest_hz;
  o.corner_px = c.corner_px;
  o.flip_share = c.flip_share;
  o.idle_channels = 1;
  const Scene scene = make_scene(c.name, {.joints = 4, .prismatic_share = c.prismatic_share}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(described(s, scene.robot), described(scene));
  // Slow joints tell it to 2 ms; another basin is 50 ms away at least.
  EXPECT_NEAR(s.time_offset_s, c.lag_s, std::max(3e-3, 5.0 * s.time_offset_sigma_s));
  EXPECT_LT(s.time_offset_sigma_s, 6e-3);
}

INSTANTIATE_TEST_SUITE_P(
    Cases, ClockOffset,
    testing::Values(OffsetCase{"OffsetSlow", -0.9, 0.3, 0.02, 0.08, 0.0, 0.0},
                    OffsetCase{"OffsetGantry", -0.04, 1.0, 0.05, 0.25, 0.15, 0.0},
                    OffsetCase{"OffsetFlips", 0.5, 0.3, 0.05, 0.25, 0.0, 0.05},
                    OffsetCase{"OffsetFast", 0.9, 0.0, 0.3, 1.2, 0.0, 0.0},
                    OffsetCase{"OffsetFastTargets", -0.17, 0.3, 0.3, 1.2, 0.25, 0.02}),
    [](const auto& tested) { return std::string(tested.param.name); });

// A joint that moves little, but well above the noise, is a joint: resting in practice is for
// markers whose corners err alike, and no channel tells how.
TEST(LittleMotion, IsFoundWhereAChannelTellsIt) {
  RecordingOptions o;
  o.sigma_m = 2e-4;
  o.sigma_rad = 0.03 * kDegree;
  o.amplitude_rad = 0.02;
  const Scene scene = make_scene("LittleMotion", {.joints = 3, .prismatic_share = 0.0}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(described(s, scene.robot), described(scene));
}

// Clocks further apart than the scan looks: said with how far, instead of a robot without channels.
TEST(ClockOffsetBeyondTheScan, IsNamedWithItsRemedy) {
  RecordingOptions o = noisy();
  o.frames = 360;
  o.lag_s = -1.7;
  const Scene scene = make_scene("OffsetBeyond", {.joints = 3}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(s.status, StructureStatus::kUndetermined);
  ASSERT_FALSE(s.doubts.empty());
  EXPECT_NE(s.doubts.front().what.find("1.70 s apart"), std::string::npos) << s.doubts.front().what;
  EXPECT_TRUE(s.doubts.front().remedy.starts_with("add -1.")) << s.doubts.front().remedy;
}

// A video written with another frame rate than it was taken with.
TEST(ClockRate, IsNamedWithItsRemedy) {
  const Scene scene = make_scene("RateApart", {.joints = 3}, noisy());
  PoseTracks tracks = scene.recording.tracks;
  for (double& t : tracks.times_s) t *= 1.1;
  const Structure s = find_structure(tracks, scene.recording.log);
  EXPECT_EQ(s.status, StructureStatus::kUndetermined);
  ASSERT_FALSE(s.doubts.empty());
  EXPECT_NE(s.doubts.front().what.find("0.909 times as fast"), std::string::npos)
      << s.doubts.front().what;
}

TEST(ALogOfAnotherRecording, IsNoAnswer) {
  const Scene scene = make_scene("Mine", {.joints = 3}, noisy());
  const Scene other = make_scene("Another", {.joints = 3}, noisy());
  const Structure s = find_structure(scene.recording.tracks, other.recording.log);
  EXPECT_EQ(s.status, StructureStatus::kUndetermined);
  ASSERT_FALSE(s.doubts.empty());
  EXPECT_NE(s.doubts.front().remedy.find("without joints.csv"), std::string::npos)
      << s.doubts.front().remedy;
}

// Its channel wraps at a turn, say: the answer is not sure while both stand alone.
TEST(AJointWithoutAChannel, CastsDoubtBesideAChannelWithoutAJoint) {
  Scene scene = make_scene("Unpaired", {.joints = 4, .prismatic_share = 0.0}, noisy());
  const int channel = scene.recording.channel_of_joint[3];
  const Scene other = make_scene("Another", {.joints = 4}, noisy());
  scene.recording.log.values.col(channel) =
      other.recording.log.values.col(0).head(scene.recording.log.values.rows());
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(s.idle_channels, std::vector<int>{channel});
  EXPECT_EQ(s.joints.size(), 4U);
  EXPECT_LE(s.probability, 0.9);
}

}  // namespace
}  // namespace kinescope
