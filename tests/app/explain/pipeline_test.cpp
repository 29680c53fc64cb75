// SPDX-License-Identifier: Apache-2.0
#include "app/explain/pipeline.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

TEST(Pipeline, ARemedyNamesFilesThatTheRecordingHas) {
  EXPECT_EQ(model_remedy(RecordingEntry::kPoses, false).find("camera"), std::string::npos);
  EXPECT_EQ(model_remedy(RecordingEntry::kPoses, false).find("tags.yaml"), std::string::npos);
  EXPECT_EQ(model_remedy(RecordingEntry::kVideo, false).find("camera.yaml"), std::string::npos);
  EXPECT_NE(model_remedy(RecordingEntry::kVideo, true).find("camera.yaml"), std::string::npos);
  EXPECT_NE(model_remedy(RecordingEntry::kVideo, true).find("tags.yaml"), std::string::npos);
}

// Corners of a film of one marker, which does not move.
Recording film(int frames) {
  Recording out;
  out.entry = RecordingEntry::kCorners;
  out.markers.default_size_m = 0.05;
  TagObservations& tags = out.corners.emplace();
  for (int f = 0; f < frames; ++f) {
    tags.times_s.push_back(0.1 * f);
    TagObservation& seen = tags.observations.emplace_back();
    seen.frame = f;
    seen.id = TagId{3};
    seen.corners_px = {{100.0, 150.0}, {150.0, 150.0}, {150.0, 100.0}, {100.0, 100.0}};
  }
  return out;
}

TEST(Pipeline, OfAFilmOfHoursFramesAreLeftOutAndAllDetectionsKept) {
  constexpr int kFrames = 90000;
  const Recording recording = film(kFrames);
  const Observed observed = observe(recording, {}, {}, {}, {});
  EXPECT_EQ(observed.tags.observations.size(), kFrames / 3);
  EXPECT_EQ(observed.measurements.corners.size(), kFrames / 3);
  EXPECT_EQ(observed.measurements.times_s.size(), kFrames / 3);
  EXPECT_EQ(frame_times(observed).size(), kFrames);
  EXPECT_EQ(all_tags(observed).observations.size(), kFrames);
  ASSERT_EQ(observed.warnings.size(), 1U);
  EXPECT_NE(observed.warnings[0].find("one frame in 3"), std::string::npos);
  EXPECT_EQ(summarise_markers(observed, recording.markers).front().frames_seen, kFrames);
}

TEST(Pipeline, OfAnOrdinaryFilmEveryFrameIsUsed) {
  const Observed observed = observe(film(300), {}, {}, {}, {});
  EXPECT_EQ(observed.measurements.corners.size(), 300U);
  EXPECT_FALSE(observed.detected.has_value());
  EXPECT_TRUE(observed.warnings.empty());
}

}  // namespace
}  // namespace kinescope
