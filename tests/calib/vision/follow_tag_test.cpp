// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/follow_tag.h"

#include <gtest/gtest.h>

#include "tests/truth/render.h"

namespace kinescope {
namespace {

constexpr TagLayout kLayout{8, true};
constexpr double kSide = 45.0;  // px

struct Picture {
  GreyImage image;
  Corners corners;
};

// A marker at a place, turned a little with it.
Picture picture(const Eigen::Vector2d& at, int id, std::uint64_t salt) {
  const CameraModel camera = pinhole_guess(220, 220, 900.0);
  PlacedMarker marker;
  marker.art = apriltag_art("tag36h11", id);
  marker.T_camera_tag = pose_showing(camera, at, kSide, marker.size_m, 0.4, 0.002 * at.x(), 0.3);
  Rng rng = Rng::from_name("follow tag", salt);
  return {render_markers(camera, {marker}, {.supersample = 4}, rng), true_corners(camera, marker)};
}

TEST(FollowTag, FindsAMarkerThatIsAboutWhereItShouldBe) {
  const Picture before = picture({100.0, 100.0}, 5, 1);
  const Picture now = picture({106.0, 103.0}, 5, 2);
  Corners expected = now.corners;
  for (Eigen::Vector2d& corner : expected) corner += Eigen::Vector2d(0.8, -0.6);
  const auto found =
      follow_tag(now.image.view(), expected, {before.image.view(), before.corners}, kLayout);
  ASSERT_TRUE(found);
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_LT((found->corners_px[c] - now.corners[c]).norm(), 5.0 * found->sigma_px);
  }
}

TEST(FollowTag, AnotherMarkerInItsPlaceIsNotTaken) {
  const Picture before = picture({100.0, 100.0}, 5, 1);
  const Picture other = picture({100.0, 100.0}, 6, 2);
  EXPECT_FALSE(follow_tag(other.image.view(), other.corners, {before.image.view(), before.corners},
                          kLayout));
}

TEST(FollowTag, AMarkerThatIsElsewhereOrGoneIsNotTaken) {
  const Picture before = picture({100.0, 100.0}, 5, 1);
  const Picture now = picture({112.0, 100.0}, 5, 2);
  EXPECT_FALSE(
      follow_tag(now.image.view(), before.corners, {before.image.view(), before.corners}, kLayout));
  GreyImage empty = now.image;
  std::ranges::fill(empty.pixels, std::uint8_t{180});
  EXPECT_FALSE(
      follow_tag(empty.view(), before.corners, {before.image.view(), before.corners}, kLayout));
}

}  // namespace
}  // namespace kinescope
