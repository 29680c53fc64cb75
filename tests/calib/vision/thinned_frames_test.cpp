// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/thinned_frames.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

// Two markers of four corners in every frame but the third.
TagObservations film(int frames) {
  TagObservations out;
  for (int f = 0; f < frames; ++f) {
    out.times_s.push_back(0.1 * f);
    for (const int id : {1, 2}) {
      if (f == 2) continue;
      TagObservation& seen = out.observations.emplace_back();
      seen.frame = f;
      seen.id = TagId{id};
      seen.corners_px.resize(4);
    }
  }
  return out;
}

std::vector<int> frames_of(const TagObservations& tags, int id) {
  std::vector<int> out;
  for (const TagObservation& seen : tags.observations)
    if (seen.id == TagId{id}) out.push_back(seen.frame);
  return out;
}

TEST(ThinFrames, KeepsEveryKthOfTheFramesThatShowAMarker) {
  TagObservations tags = film(9);
  EXPECT_EQ(thin_frames(tags, 23), 3);
  const std::vector<int> kept = {0, 4, 7};
  EXPECT_EQ(frames_of(tags, 1), kept);
  EXPECT_EQ(frames_of(tags, 2), kept);
  EXPECT_EQ(tags.times_s.size(), 9U);
  // What was thinned already stays.
  EXPECT_EQ(thin_frames(tags, 24), 1);
  EXPECT_EQ(frames_of(tags, 1), kept);
}

TEST(ThinFrames, LeavesWhatIsNoMoreThanAllowed) {
  TagObservations tags = film(9);
  EXPECT_EQ(thin_frames(tags, 64), 1);
  EXPECT_EQ(tags.observations.size(), 16U);
  TagObservations none;
  EXPECT_EQ(thin_frames(none), 1);
}

}  // namespace
}  // namespace kinescope
