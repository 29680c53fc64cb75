// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/lost_markers.h"

#include <functional>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr int kFilmed = 200;

// Five markers at 10 Hz; `is_rejected` of a marker's number and the frame.
Calibration filmed(const std::function<bool(int, int)>& is_rejected) {
  Calibration out;
  for (int frame = 0; frame < kFilmed; ++frame) {
    out.times_s.push_back(0.1 * frame);
    for (int id = 0; id < 5; ++id) {
      SightingResidual one;
      one.frame = frame;
      one.id = TagId{id};
      one.used = !is_rejected(id, frame);
      out.residuals.push_back(one);
    }
  }
  return out;
}

TEST(LostMarkers, AreThoseThatAreElsewhereFromAnInstantOnOrUpToOne) {
  const std::vector<LostMarker> lost = lost_markers(filmed(
      [](int id, int frame) { return (id == 2 && frame >= 130) || (id == 4 && frame <= 60); }));
  ASSERT_EQ(lost.size(), 2U);
  EXPECT_EQ(lost[0].id, TagId{2});
  EXPECT_TRUE(lost[0].is_lost_from);
  EXPECT_DOUBLE_EQ(lost[0].at_s, 13.0);
  EXPECT_EQ(lost[0].sightings, 70);
  EXPECT_FALSE(lost[0].is_lost_at(12.9));
  EXPECT_TRUE(lost[0].is_lost_at(13.0));
  EXPECT_EQ(lost[1].id, TagId{4});
  EXPECT_FALSE(lost[1].is_lost_from);
  EXPECT_DOUBLE_EQ(lost[1].at_s, 6.0);
  EXPECT_EQ(lost[1].sightings, 61);
}

// Some of the sightings behind the instant come by where the robot has the marker, and some before
// it were outliers.
TEST(LostMarkers, AreFoundBesideOutliers) {
  Rng rng = Rng::from_name("lost markers");
  const std::vector<LostMarker> lost = lost_markers(filmed(
      [&](int id, int frame) { return rng.uniform() < (id == 1 && frame >= 90 ? 0.9 : 0.05); }));
  ASSERT_EQ(lost.size(), 1U);
  EXPECT_EQ(lost[0].id, TagId{1});
  EXPECT_NEAR(lost[0].at_s, 9.0, 0.5);
}

TEST(LostMarkers, AreNoneThatOutliersCome) {
  Rng rng = Rng::from_name("no lost markers");
  for (const double share : {0.0, 0.1, 0.3, 0.6}) {
    for (int run = 0; run < 50; ++run)
      EXPECT_TRUE(lost_markers(filmed([&](int, int) { return rng.uniform() < share; })).empty());
  }
}

// A stretch in the middle is something else, and so is what most of the markers do.
TEST(LostMarkers, AreNoneOfAStretchNorWhereMostAreRejected) {
  EXPECT_TRUE(lost_markers(filmed([](int id, int frame) {
                return id == 2 && frame >= 80 && frame < 120;
              })).empty());
  EXPECT_TRUE(
      lost_markers(filmed([](int id, int frame) { return id >= 2 && frame >= 130; })).empty());
}

}  // namespace
}  // namespace kinescope
