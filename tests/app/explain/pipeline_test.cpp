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

// As photographs of a board of many corners are, at whatever times.
TEST(Pipeline, OfPosturesEveryFrameIsUsedHoweverMany) {
  constexpr int kFrames = 40000;
  Recording recording = film(kFrames);
  const TagObservations tags = value_of(recording.corners);
  recording.log.channels = {"q"};
  recording.log.times_s = tags.times_s;
  recording.log.values.resize(kFrames, 1);
  for (Eigen::Index row = 0; row < kFrames; ++row)
    recording.log.values(row, 0) = static_cast<double>(row * 7919 % 1000) / 1000.0;
  EXPECT_EQ(observe(recording, {}, {}, {}, {}).tags.observations.size(), kFrames);
  for (double& time_s : recording.corners->times_s) time_s *= 10.0;  // one a second, without a log
  recording.log = {};
  EXPECT_EQ(observe(recording, {}, {}, {}, {}).tags.observations.size(), kFrames);
}

// Of several recordings that are thinned once more, all together.
TEST(Pipeline, WhatWasDetectedStaysWhereAFilmIsThinnedTwice) {
  constexpr int kFrames = 60000;
  const Recording recording = film(kFrames);
  Observed observed = observe(recording, {}, {}, {}, {});
  leave_out_neighbours(recording, 5, observed);
  EXPECT_EQ(observed.measurements.corners.size(), kFrames / 10);
  EXPECT_EQ(observed.measurements.times_s.size(), kFrames / 10);
  EXPECT_EQ(all_tags(observed).observations.size(), kFrames);
  EXPECT_EQ(frame_times(observed).size(), kFrames);
}

TEST(Pipeline, OfAnOrdinaryFilmEveryFrameIsUsed) {
  const Observed observed = observe(film(300), {}, {}, {}, {});
  EXPECT_EQ(observed.measurements.corners.size(), 300U);
  EXPECT_FALSE(observed.detected.has_value());
  EXPECT_TRUE(observed.warnings.empty());
}

}  // namespace
}  // namespace kinescope
