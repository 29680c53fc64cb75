// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/find_tone.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "tests/truth/render.h"

namespace kinescope {
namespace {

constexpr int kMarkers = 6;
constexpr int kViewsOfEach = 2;
const TagLayout kTag36h11{};

// Pictures of one camera, about 60 px large.
struct Pictures {
  std::vector<GreyImage> images;
  std::vector<Corners> truth;
  std::vector<ToneView> views;

  explicit Pictures(const ImageOptions& options) {
    Rng rng = Rng::from_name("find tone");
    const CameraModel camera = pinhole_guess(120, 120, 900.0);
    for (int i = 0; i < kMarkers * kViewsOfEach; ++i) {
      PlacedMarker marker;
      marker.art = apriltag_art("tag36h11", i % kMarkers);
      const auto turn = [&] { return rng.uniform(0.0, 2.0 * std::numbers::pi); };
      const double x = rng.uniform(55.0, 65.0);
      const double y = rng.uniform(55.0, 65.0);
      const double tilt = rng.uniform(0.0, 0.7);
      const double direction = turn();
      marker.T_camera_tag =
          pose_showing(camera, {x, y}, 60.0, marker.size_m, tilt, direction, turn());
      images.push_back(render_markers(camera, {marker}, options, rng));
      truth.push_back(true_corners(camera, marker));
    }
    for (std::size_t i = 0; i < images.size(); ++i) {
      const RefinedCorners refined = refine_border(images[i].view(), truth[i], kTag36h11);
      EXPECT_EQ(refined.status, RefineStatus::kDone);
      views.push_back({images[i].view(), TagId{static_cast<int>(i) % kMarkers}, refined.corners_px,
                       PlacedMarker{}.size_m});
    }
  }

  // Mean over all corners of how far the border's fit puts them outward of where they should be,
  // px.
  [[nodiscard]] double outward(const ToneCurve& tone) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < images.size(); ++i) {
      const Corners found = refine_border(images[i].view(), truth[i], kTag36h11, tone).corners_px;
      const Eigen::Vector2d middle = 0.25 * (truth[i][0] + truth[i][1] + truth[i][2] + truth[i][3]);
      for (std::size_t c = 0; c < 4; ++c)
        sum += (found[c] - truth[i][c]).dot((truth[i][c] - middle).normalized());
    }
    return sum / (4.0 * static_cast<double>(images.size()));
  }
};

TEST(FindTone, CornersAreWhereTheyShouldBeInItsLight) {
  for (const double gamma : {1.8, 2.2}) {
    const Pictures pictures({.supersample = 4, .gamma = gamma});
    EXPECT_LT(pictures.outward(ToneCurve()), -0.25);
    const std::optional<FoundTone> found = find_tone(pictures.views, kTag36h11);
    ASSERT_TRUE(found && found->is_explained());
    EXPECT_NEAR(found->curve.gamma(), gamma, 0.08);
    EXPECT_NEAR(pictures.outward(found->curve), 0.0, 0.02);
    EXPECT_GT(found->shift_px, 0.15);
    EXPECT_LT(found->sigma_per_blur, 0.03);
  }
}

TEST(FindTone, NothingInLinearPictures) {
  for (const double noise : {2.0, 6.0}) {
    const Pictures pictures({.noise = noise, .supersample = 4});
    EXPECT_FALSE(find_tone(pictures.views, kTag36h11));
  }
}

// What is whiter than white spreads further than any tone curve lets it.
TEST(FindTone, OverexposureIsNoToneCurve) {
  const Pictures pictures({.black = 60.0, .white = 2500.0, .supersample = 4});
  const std::optional<FoundTone> found = find_tone(pictures.views, kTag36h11);
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->is_explained());
  EXPECT_GT(found->shift_px, 0.3);
}

TEST(FindTone, FewViewsTellNothing) {
  const Pictures pictures({.supersample = 4, .gamma = 2.2});
  EXPECT_FALSE(find_tone(std::span(pictures.views).first(kFewestToneViews - 1), kTag36h11));
  EXPECT_FALSE(find_tone({}, kTag36h11));
}

TEST(ToneCurve, GreyAndLightAreInverse) {
  const ToneCurve curve(2.2);
  for (const double grey : {20.0, 60.0, 128.0, 240.0, 255.0})
    EXPECT_NEAR(curve.grey(curve.light(grey)), grey, 0.02);
  EXPECT_NEAR(curve.light(255.0), 255.0, 1e-9);
  EXPECT_NEAR(curve.light(std::uint8_t{128}), curve.light(128.0), 1e-9);
  EXPECT_EQ(ToneCurve().grey(77.5), 77.5);
}

}  // namespace
}  // namespace kinescope
