// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/repeated_frames.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

// Two markers, the one in motion of `moving` at the places given, px.
TagObservations film(const std::vector<double>& places) {
  TagObservations out;
  for (std::size_t f = 0; f < places.size(); ++f) {
    out.times_s.push_back(0.1 * static_cast<double>(f));
    for (const int id : {1, 2}) {
      TagObservation& seen = out.observations.emplace_back();
      seen.frame = static_cast<int>(f);
      seen.id = TagId{id};
      seen.sigma_px = 0.1;
      const double x = id == 1 ? 100.0 : places[f];
      seen.corners_px = {{x, 50.0}, {x + 20.0, 50.0}, {x + 20.0, 30.0}, {x, 30.0}};
    }
  }
  return out;
}

std::vector<int> frames_of(const TagObservations& tags) {
  std::vector<int> out;
  for (const TagObservation& seen : tags.observations)
    if (seen.id == TagId{2}) out.push_back(seen.frame);
  return out;
}

TEST(RepeatedFrames, AreLeftOutWhileTheRobotMoves) {
  TagObservations tags = film({10, 12, 14, 14, 18, 20, 20, 20, 26, 28});
  leave_out_repeated_frames(tags);
  EXPECT_EQ(frames_of(tags), (std::vector<int>{0, 1, 2, 4, 5, 8, 9}));
  EXPECT_EQ(tags.rejected.size(), 6U);
  const std::vector<std::string> words = repeated_frame_words(tags);
  ASSERT_EQ(words.size(), 1U);
  EXPECT_NE(words[0].find("3 of the 10 frames show the image before once more"), std::string::npos);
  // Of what is left nothing repeats, and what was said stays.
  leave_out_repeated_frames(tags);
  EXPECT_EQ(tags.rejected.size(), 6U);
}

TEST(RepeatedFrames, ARobotAtRestLooksAlike) {
  TagObservations tags = film({10, 10, 10, 12, 14, 16, 16.2, 16.2, 16.2, 16.2});
  leave_out_repeated_frames(tags);
  EXPECT_EQ(frames_of(tags).size(), 10U);
  EXPECT_TRUE(repeated_frame_words(tags).empty());
  // A stop on the way: slow before it, slow after it.
  tags = film({10, 12, 13, 13.3, 13.4, 13.4, 13.4, 13.5, 13.9, 15});
  leave_out_repeated_frames(tags);
  EXPECT_EQ(frames_of(tags).size(), 10U);
}

}  // namespace
}  // namespace kinescope
