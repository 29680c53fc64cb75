// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/tag_windows.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;

TagObservation marker(int id, const Eigen::Vector2d& centre, double edge) {
  TagObservation out;
  out.id = TagId{id};
  const double h = 0.5 * edge;
  for (const Eigen::Vector2d& d : {Eigen::Vector2d{-h, h}, Eigen::Vector2d{h, h},
                                   Eigen::Vector2d{h, -h}, Eigen::Vector2d{-h, -h}}) {
    out.corners_px.emplace_back(centre + d);
  }
  return out;
}

TEST(TagWindows, HoldTheMarkerAndItsMarginInsideTheImage) {
  const TagObservation tag = marker(3, {100.0, 80.0}, 40.0);
  const auto window = window_around(tag.id, tag.corners_px, 5.0, kWidth, kHeight);
  ASSERT_TRUE(window);
  EXPECT_EQ(window->id, TagId{3});
  // 20 px to the corners, 5 asked for, 0.6 edges and 8 px of margin.
  EXPECT_EQ(window->x0, 43);
  EXPECT_EQ(window->x1, 157);
  EXPECT_EQ(window->y0, 23);
  EXPECT_EQ(window->y1, 137);
}

TEST(TagWindows, AreCutAtTheImageAndNoneBeyondIt) {
  const TagObservation tag = marker(3, {310.0, 5.0}, 40.0);
  const auto window = window_around(tag.id, tag.corners_px, 0.0, kWidth, kHeight);
  ASSERT_TRUE(window);
  EXPECT_EQ(window->x1, kWidth - 1);
  EXPECT_EQ(window->y0, 0);
  const TagObservation gone = marker(3, {500.0, 100.0}, 40.0);
  EXPECT_FALSE(window_around(gone.id, gone.corners_px, 0.0, kWidth, kHeight));
}

TEST(TagWindows, FollowTheMotion) {
  const TagObservation before = marker(7, {100.0, 100.0}, 20.0);
  const TagObservation last = marker(7, {160.0, 110.0}, 20.0);
  const TagObservation next = marker(7, {220.0, 120.0}, 20.0);
  const TagPrediction followed = predict_tag(last, {before});
  EXPECT_TRUE(followed.motion_known);
  EXPECT_EQ(followed.corners_px, next.corners_px);
  EXPECT_GT(followed.reach, 0.0);
  const TagPrediction unknown = predict_tag(last, {});
  EXPECT_FALSE(unknown.motion_known);
  EXPECT_EQ(unknown.corners_px, last.corners_px);
}

}  // namespace
}  // namespace kinescope
