// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/sightings.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr int kSightingFrames = 60;

TagObservation sighting(int frame, int id, double x, double margin = 80.0, double edge = 30.0) {
  TagObservation tag;
  tag.frame = frame;
  tag.id = TagId{id};
  tag.decision_margin = margin;
  tag.corners_px = {{x, 100.0 + edge}, {x + edge, 100.0 + edge}, {x + edge, 100.0}, {x, 100.0}};
  return tag;
}

// Marker 3 passes to the right, two px a frame.
TagObservations passing() {
  TagObservations all;
  for (int f = 0; f < kSightingFrames; ++f) {
    all.times_s.push_back(f / 30.0);
    all.observations.push_back(sighting(f, 3, 50.0 + 2.0 * f));
  }
  return all;
}

MarkerSet declared() {
  MarkerSet markers;
  markers.default_size_m = 0.05;
  return markers;
}

int rejected(const TagObservations& all, const std::string& why) {
  int count = 0;
  for (const RejectedTag& tag : all.rejected) {
    if (tag.reason.find(why) != std::string::npos) ++count;
  }
  return count;
}

TEST(Sightings, AQuietRecordingKeepsAll) {
  TagObservations all = passing();
  EXPECT_TRUE(sort_out_sightings(all, declared(), 5).empty());
  EXPECT_EQ(all.observations.size(), static_cast<std::size_t>(kSightingFrames));
  EXPECT_TRUE(all.rejected.empty());
}

TEST(Sightings, IdsSeenRarelyAreGhosts) {
  TagObservations all = passing();
  for (const int f : {4, 20, 21, 40}) all.observations.push_back(sighting(f, 17, 300.0));
  (void)sort_out_sightings(all, declared(), 5);
  EXPECT_EQ(all.observations.size(), static_cast<std::size_t>(kSightingFrames));
  EXPECT_EQ(rejected(all, "fewer than 5"), 4);
}

TEST(Sightings, UndeclaredIdsAreGhosts) {
  MarkerSet markers = declared();
  markers.sizes_m[TagId{3}] = 0.04;
  markers.sizes_m[TagId{8}] = 0.04;
  markers.only_listed = true;
  TagObservations all = passing();
  for (int f = 0; f < 30; ++f) all.observations.push_back(sighting(f, 17, 300.0));
  const auto warnings = sort_out_sightings(all, markers, 5);
  EXPECT_EQ(rejected(all, "not listed"), 30);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("marker 8"), std::string::npos);

  markers.only_listed = false;
  markers.default_size_m = 0.0;
  all = passing();
  for (int f = 0; f < 30; ++f) all.observations.push_back(sighting(f, 17, 300.0));
  (void)sort_out_sightings(all, markers, 5);
  EXPECT_EQ(rejected(all, "no size"), 30);
}

TEST(Sightings, OfTwoTheOneOnItsTrackIsKept) {
  TagObservations all = passing();
  all.observations.push_back(sighting(30, 3, 400.0, 200.0));  // elsewhere, and clearer
  (void)sort_out_sightings(all, declared(), 5);
  EXPECT_EQ(all.observations.size(), static_cast<std::size_t>(kSightingFrames));
  EXPECT_EQ(rejected(all, "second marker"), 1);
  EXPECT_EQ(all.observations[30].corners_px[0].x(), 110.0);
}

TEST(Sightings, TwoMarkersWithOneIdAreBothRejectedAndReported) {
  TagObservations all;
  for (int f = 0; f < kSightingFrames; ++f) {
    all.times_s.push_back(f / 30.0);
    all.observations.push_back(sighting(f, 3, 50.0));
    all.observations.push_back(sighting(f, 3, 250.0));
  }
  const auto warnings = sort_out_sightings(all, declared(), 5);
  EXPECT_TRUE(all.observations.empty());
  EXPECT_EQ(rejected(all, "not to be told apart"), 2 * kSightingFrames);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("two markers with id 3 are in view: remove one"), std::string::npos);
}

TEST(Sightings, JumpsAwayAndBackAreRejected) {
  TagObservations all = passing();
  all.observations[30] = sighting(30, 3, 300.0);
  (void)sort_out_sightings(all, declared(), 5);
  EXPECT_EQ(all.observations.size(), static_cast<std::size_t>(kSightingFrames - 1));
  ASSERT_EQ(rejected(all, "jumps"), 1);
  EXPECT_EQ(all.rejected[0].frame, 30);
}

TEST(Sightings, ATurnOfTheCornersIsAJump) {
  TagObservations all = passing();
  std::rotate(all.observations[30].corners_px.begin(), all.observations[30].corners_px.begin() + 2,
              all.observations[30].corners_px.end());
  (void)sort_out_sightings(all, declared(), 5);
  EXPECT_EQ(rejected(all, "jumps"), 1);
}

TEST(Sightings, PosturesFarApartInTimeMayJump) {
  TagObservations all;
  for (int f = 0; f < 20; ++f) {
    all.times_s.push_back(5.0 * f);
    all.observations.push_back(sighting(f, 3, f % 2 == 0 ? 50.0 : 500.0));
  }
  (void)sort_out_sightings(all, declared(), 5);
  EXPECT_EQ(all.observations.size(), 20U);
}

TEST(Sightings, ImpossibleShapesAreRejected) {
  std::vector<Eigen::Vector2d> good = sighting(0, 1, 10.0).corners_px;
  EXPECT_FALSE(impossible_shape(good));
  std::vector<Eigen::Vector2d> mirrored(good.rbegin(), good.rend());
  EXPECT_EQ(impossible_shape(mirrored), "mirrored");
  std::vector<Eigen::Vector2d> bow = {good[0], good[2], good[1], good[3]};
  EXPECT_EQ(impossible_shape(bow), "corners are not convex");
  std::vector<Eigen::Vector2d> dented = good;
  dented[0] = {30.0, 110.0};
  EXPECT_EQ(impossible_shape(dented), "corners are not convex");
  EXPECT_EQ(impossible_shape(sighting(0, 1, 10.0, 80.0, 3.0).corners_px), "too small");
  std::vector<Eigen::Vector2d> nan = good;
  nan[2].x() = std::nan("");
  EXPECT_TRUE(impossible_shape(nan));
}

TEST(Sightings, ResultDoesNotDependOnTheOrder) {
  TagObservations all = passing();
  all.observations.push_back(sighting(30, 3, 400.0));
  all.observations.push_back(sighting(12, 9, 400.0));
  TagObservations shuffled = all;
  std::ranges::reverse(shuffled.observations);
  (void)sort_out_sightings(all, declared(), 5);
  (void)sort_out_sightings(shuffled, declared(), 5);
  ASSERT_EQ(all.observations.size(), shuffled.observations.size());
  for (std::size_t i = 0; i < all.observations.size(); ++i) {
    EXPECT_EQ(all.observations[i].frame, shuffled.observations[i].frame);
    EXPECT_EQ(all.observations[i].corners_px, shuffled.observations[i].corners_px);
  }
  EXPECT_EQ(all.rejected.size(), shuffled.rejected.size());
}

TEST(Sightings, CornersThatCouldNotBeFittedAreLeftWhereTheOthersCould) {
  TagObservations all = passing();
  for (const int f : {7, 30, 31}) all.observations[static_cast<std::size_t>(f)].fitted = false;
  put_unfitted_aside(all);
  EXPECT_EQ(all.observations.size(), static_cast<std::size_t>(kSightingFrames - 3));
  EXPECT_EQ(rejected(all, "could not be fitted"), 3);
}

// A small or blurred marker has no others.
TEST(Sightings, CornersThatCanSeldomBeFittedAreKept) {
  TagObservations all = passing();
  for (int f = 0; f < kSightingFrames; f += 3)
    all.observations[static_cast<std::size_t>(f)].fitted = false;
  put_unfitted_aside(all);
  EXPECT_EQ(all.observations.size(), static_cast<std::size_t>(kSightingFrames));
  EXPECT_TRUE(all.rejected.empty());
}

}  // namespace
}  // namespace kinescope
