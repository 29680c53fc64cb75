// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/pattern_shift.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/truth/render.h"

namespace kinescope {
namespace {

constexpr std::array<double, 3> kSides = {24.0, 40.0, 110.0};  // px
constexpr int kShiftTrials = 6;
constexpr double kStartSigma = 0.3;  // px, of the detector

struct WideLensPicture {
  GreyImage image;
  Corners corners;
};

WideLensPicture wide_lens_picture(const std::string& family, double side, int trial,
                                  const ImageOptions& options) {
  Rng rng = Rng::from_name("pattern shift " + family, static_cast<std::uint64_t>(trial));
  // Away from the middle of a wide lens.
  CameraModel camera = pinhole_guess(190, 190, 700.0);
  camera.cx = -100.0;
  camera.distortion = {-0.25, 0.08};
  PlacedMarker marker;
  marker.art =
      family.starts_with("tag") ? apriltag_art(family, rng.index(20)) : aruco_art(0, rng.index(20));
  marker.T_camera_tag = pose_showing(
      camera, {rng.uniform(90.0, 100.0), rng.uniform(90.0, 100.0)}, side, marker.size_m,
      rng.uniform(0.0, 55.0) * std::numbers::pi / 180.0, rng.uniform(0.0, 2.0 * std::numbers::pi),
      rng.uniform(0.0, 2.0 * std::numbers::pi));
  return {render_markers(camera, {marker}, options, rng), true_corners(camera, marker)};
}

// Something white over a strip along one edge, up to `depth` px inside; the corners are what a
// border found there would give.
void cover(WideLensPicture& scene, std::size_t edge, double depth, const ImageOptions& options) {
  const Eigen::Vector2d a = scene.corners[edge];
  const Eigen::Vector2d b = scene.corners[(edge + 1) % 4];
  const Eigen::Vector2d along = (b - a).normalized();
  const Eigen::Vector2d outward(-along.y(), along.x());
  for (int y = 0; y < scene.image.height; ++y) {
    for (int x = 0; x < scene.image.width; ++x) {
      const double d = outward.dot(Eigen::Vector2d(x, y) - a) + depth;
      const double share = 0.5 * std::erfc(-d / (std::numbers::sqrt2 * options.blur_px));
      std::uint8_t& pixel = scene.image.pixels[static_cast<std::size_t>(y * scene.image.width + x)];
      pixel = static_cast<std::uint8_t>(std::lround(share * options.white + (1.0 - share) * pixel));
    }
  }
  for (const std::size_t end : {edge, (edge + 1) % 4}) {
    const std::size_t other = end == edge ? (edge + 3) % 4 : (edge + 2) % 4;
    const Eigen::Vector2d inward = scene.corners[other] - scene.corners[end];
    scene.corners[end] -= inward * (depth / inward.dot(outward));
  }
}

// As the fit of the border gives it, or as the detector gives it where no fit was possible.
RefinedCorners border_of(const WideLensPicture& scene, const ImageOptions& options,
                         RefineStatus status, Rng& rng) {
  if (status != RefineStatus::kDone) {
    RefinedCorners out{.status = status, .corners_px = scene.corners};
    for (Eigen::Vector2d& corner : out.corners_px)
      corner += kStartSigma * Eigen::Vector2d(rng.normal(), rng.normal());
    return out;
  }
  return {.status = status,
          .corners_px = scene.corners,
          .sigma_px = 0.03,
          .contrast = options.white - options.black,
          .noise = options.noise,
          .blur_px = options.blur_px};
}

int count_hidden(const std::string& family, double side, double covered_cells,
                 const ImageOptions& options, RefineStatus status = RefineStatus::kDone) {
  const TagLayout layout = tag_layout(family);
  Rng rng = Rng::from_name("border " + family, static_cast<std::uint64_t>(side));
  int hidden = 0;
  for (int trial = 0; trial < kShiftTrials; ++trial) {
    WideLensPicture scene = wide_lens_picture(family, side, trial, options);
    const auto edge = static_cast<std::size_t>(trial % 4);
    if (covered_cells > 0.0) {
      const double cell =
          (scene.corners[(edge + 2) % 4] - scene.corners[(edge + 1) % 4]).norm() / layout.cells;
      cover(scene, edge, covered_cells * cell, options);
    }
    hidden += is_partly_hidden(scene.image.view(), border_of(scene, options, status, rng), layout,
                               kStartSigma)
                  ? 1
                  : 0;
  }
  return hidden;
}

TEST(PatternShift, BelievesWhatIsWhollySeen) {
  const std::array<ImageOptions, 4> kinds = {
      {{.supersample = 3},
       {.blur_px = 1.5, .supersample = 3},
       {.noise = 8.0, .supersample = 3},
       {.black = 90.0, .white = 150.0, .noise = 4.0, .supersample = 3}}};
  for (const char* family : {"tag36h11", "tagStandard41h12", "tag16h5", "DICT_4X4_50"}) {
    for (const double side : kSides) {
      for (const ImageOptions& options : kinds) {
        EXPECT_EQ(count_hidden(family, side, 0.0, options), 0)
            << family << " " << side << " px, blur " << options.blur_px << ", noise "
            << options.noise;
      }
    }
  }
}

TEST(PatternShift, SeesThatAnEdgeIsCovered) {
  constexpr double kMost = 0.7;  // a far edge, tilted, is covered by less than a pixel
  for (const char* family : {"tag36h11", "DICT_4X4_50"}) {
    for (const double side : {50.0, 110.0}) {
      EXPECT_GE(count_hidden(family, side, 0.3, {.supersample = 3}), kMost * kShiftTrials)
          << family << " " << side << " px";
    }
  }
}

TEST(PatternShift, LooksAtTheDetectorsCornersWhereNoBorderCouldBeFitted) {
  int doubted = 0;
  int covered = 0;
  int all = 0;
  for (const char* family : {"tag36h11", "DICT_4X4_50"}) {
    for (const double side : {40.0, 60.0, 110.0}) {
      for (const double blur : {0.7, 1.2}) {
        const ImageOptions options{.blur_px = blur, .supersample = 3};
        doubted += count_hidden(family, side, 0.0, options, RefineStatus::kMoved);
        covered += count_hidden(family, side, 0.5, options, RefineStatus::kMoved);
        all += kShiftTrials;
      }
    }
  }
  EXPECT_LE(doubted, 0.1 * all) << "of " << all;
  EXPECT_GE(covered, 0.6 * all) << "of " << all;
  const ImageOptions options{.supersample = 3};
  EXPECT_EQ(count_hidden("tag36h11", 60.0, 0.5, options, RefineStatus::kTooFewPixels), 0);
}

TEST(PatternShift, SaysNothingWithoutContrastOrQuadrangle) {
  const GreyImage grey{100, 100, std::vector<std::uint8_t>(10000, 128)};
  const Corners square = {Eigen::Vector2d{20, 80}, {80, 80}, {80, 20}, {20, 20}};
  EXPECT_FALSE(pattern_shift(grey.view(), square, {8, true}));
  const Corners line = {Eigen::Vector2d{20, 20}, {40, 20}, {60, 20}, {80, 20}};
  EXPECT_FALSE(pattern_shift(grey.view(), line, {8, true}));
  const Corners outside = {Eigen::Vector2d{-50, 150}, {150, 150}, {150, -50}, {-50, -50}};
  EXPECT_FALSE(pattern_shift(grey.view(), outside, {8, true}));
}

}  // namespace
}  // namespace kinescope
