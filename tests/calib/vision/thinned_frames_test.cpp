// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/thinned_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kinescope {
namespace {

// Two markers of four corners in every frame but the third.
TagObservations film(int frames) {
  TagObservations out;
  for (int f = 0; f < frames; ++f) {
    out.times_s.push_back(0.5 * f);
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

TEST(ThinnedFrames, AreEveryKthOfThoseThatShowAMarkerAndOfTheOthers) {
  TagObservations tags = film(9);
  tags.rejected = {{2, TagId{3}, ""}, {3, TagId{3}, ""}};
  const TagObservations thinned = every_kth_frame(tags, 3);
  EXPECT_THAT(thinned.times_s, testing::ElementsAre(0.0, 1.0, 2.0, 3.5));
  EXPECT_THAT(frames_of(thinned, 1), testing::ElementsAre(0, 2, 3));
  EXPECT_THAT(frames_of(thinned, 2), testing::ElementsAre(0, 2, 3));
  ASSERT_EQ(thinned.rejected.size(), 1U);
  EXPECT_EQ(thinned.rejected.front().frame, 1);
  EXPECT_EQ(corners_of(tags), 64U);
  EXPECT_EQ(corners_of(thinned), 24U);
}

TEST(ThinnedFrames, LeaveNoMoreThanAllowed) {
  EXPECT_EQ(thinning_of(64, 64), 1);
  EXPECT_EQ(thinning_of(0), 1);
  EXPECT_EQ(thinning_of(65, 64), 2);
  EXPECT_EQ(thinning_of(64, 23), 3);
}

}  // namespace
}  // namespace kinescope
