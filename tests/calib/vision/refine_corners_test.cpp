// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/refine_corners.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/truth/render.h"

namespace kinescope {
namespace {

// 2-D RMS of a corner at contrast 200, noise 2, blur 0.7, tilts up to 55 degrees. The packaged
// detector has 0.21, 0.090, 0.064, 0.065, 0.059 px at these sides.
struct Goal {
  double side_px;
  double rms_px;
  double bias_px;  // outward
};
constexpr std::array<Goal, 4> kGoals = {
    {{24.0, 0.022, 0.005}, {30.0, 0.017, 0.005}, {60.0, 0.012, 0.003}, {120.0, 0.01, 0.003}}};
constexpr int kTrials = 40;
// Squared error over sigma^2, mean of 160 corners; the sigma holds a floor, so it is on the safe
// side.
constexpr double kChi2Most = 1.3;
constexpr double kChi2Least = 0.25;

const CameraModel kLens = pinhole_guess(220, 220, 900.0);

struct MarkerPicture {
  GreyImage image;
  Corners truth;
};

MarkerPicture render_marker(double side, std::uint64_t salt, const ImageOptions& options,
                            double max_tilt_deg = 55.0) {
  Rng rng = Rng::from_name("refine corners", salt);
  PlacedMarker marker;
  marker.art = apriltag_art("tag36h11", rng.index(500));
  marker.T_camera_tag = pose_showing(
      kLens, {110.0 + rng.uniform(-5.0, 5.0), 110.0 + rng.uniform(-5.0, 5.0)}, side, marker.size_m,
      rng.uniform(0.0, max_tilt_deg) * std::numbers::pi / 180.0,
      rng.uniform(0.0, 2.0 * std::numbers::pi), rng.uniform(0.0, 2.0 * std::numbers::pi));
  MarkerPicture scene{render_markers(kLens, {marker}, options, rng), true_corners(kLens, marker)};
  return scene;
}

Corners disturbed(const Corners& corners, double size, std::uint64_t salt) {
  Rng rng = Rng::from_name("disturbed corners", salt);
  Corners out = corners;
  for (Eigen::Vector2d& corner : out) {
    corner += Eigen::Vector2d(rng.uniform(-size, size), rng.uniform(-size, size));
  }
  return out;
}

RefinedCorners refined(const GreyImage& image, const Corners& start, const TagLayout& layout = {}) {
  return refine_corners(image.view(), start, layout, ToneCurve(), &kLens);
}

TEST(RefineCorners, ReachesItsGoalsWithAnHonestSigma) {
  for (const Goal& goal : kGoals) {
    double squared = 0.0;
    double outward = 0.0;
    double whitened = 0.0;
    int corners = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      const auto salt = static_cast<std::uint64_t>(trial);
      const MarkerPicture scene = render_marker(goal.side_px, salt, {.supersample = 6});
      const RefinedCorners found = refined(scene.image, disturbed(scene.truth, 0.3, salt));
      if (found.status != RefineStatus::kDone) continue;
      const Eigen::Vector2d middle =
          0.25 * (scene.truth[0] + scene.truth[1] + scene.truth[2] + scene.truth[3]);
      for (std::size_t i = 0; i < 4; ++i) {
        const Eigen::Vector2d error = found.corners_px[i] - scene.truth[i];
        squared += error.squaredNorm();
        outward += error.dot((scene.truth[i] - middle).normalized());
        whitened += error.squaredNorm() / (found.sigma_px * found.sigma_px);
        ++corners;
      }
    }
    ASSERT_GE(corners, 4 * kTrials * 9 / 10) << goal.side_px;
    EXPECT_LT(std::sqrt(squared / corners), goal.rms_px) << goal.side_px;
    EXPECT_LT(std::abs(outward / corners), goal.bias_px) << goal.side_px;
    EXPECT_LT(whitened / (2.0 * corners), kChi2Most) << goal.side_px;
    EXPECT_GT(whitened / (2.0 * corners), kChi2Least) << goal.side_px;
  }
}

TEST(RefineCorners, ItsEllipsesHoldTheTruth) {
  constexpr double kSquare95 = 5.991;  // of chi square with two degrees of freedom
  int inside = 0;
  int corners = 0;
  for (const double side : {60.0, 90.0}) {
    for (std::uint64_t salt = 0; salt < 30; ++salt) {
      const MarkerPicture scene = render_marker(side, salt, {.supersample = 4});
      const RefinedCorners found = refined(scene.image, disturbed(scene.truth, 0.3, salt));
      ASSERT_EQ(found.status, RefineStatus::kDone);
      for (std::size_t i = 0; i < 4; ++i, ++corners) {
        const double error = (found.corners_px[i] - scene.truth[i]).squaredNorm();
        inside += error < kSquare95 * found.sigma_px * found.sigma_px ? 1 : 0;
      }
    }
  }
  // 240 corners, four of a tag not independent: 2 % either way is chance.
  EXPECT_GT(inside, 0.925 * corners);
  EXPECT_LT(inside, 0.985 * corners);
}

TEST(RefineCorners, DoesNotDependOnTheStart) {
  constexpr double kSame = 0.004;  // px, a fraction of sigma
  for (std::uint64_t salt = 0; salt < 10; ++salt) {
    const MarkerPicture scene = render_marker(50.0, salt, {.supersample = 6});
    const RefinedCorners a = refined(scene.image, disturbed(scene.truth, 0.6, salt));
    const RefinedCorners b = refined(scene.image, disturbed(scene.truth, 0.6, salt + 100));
    ASSERT_EQ(a.status, RefineStatus::kDone);
    ASSERT_EQ(b.status, RefineStatus::kDone);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_LT((a.corners_px[i] - b.corners_px[i]).norm(), kSame) << salt;
    }
  }
}

// Small cells, no tone curve known: the border alone is 0.4 px inward.
TEST(RefineCorners, AToneCurveDoesNotShrinkSmallMarkers) {
  for (const double side : {24.0, 30.0}) {
    double outward = 0.0;
    double border_outward = 0.0;
    for (std::uint64_t salt = 0; salt < 12; ++salt) {
      const MarkerPicture scene = render_marker(side, salt, {.supersample = 6, .gamma = 2.2}, 30.0);
      const RefinedCorners border = refine_border(scene.image.view(), scene.truth, {});
      const RefinedCorners found = refined(scene.image, scene.truth);
      ASSERT_TRUE(found.by_cells) << salt;
      const Eigen::Vector2d middle =
          0.25 * (scene.truth[0] + scene.truth[1] + scene.truth[2] + scene.truth[3]);
      for (std::size_t i = 0; i < 4; ++i) {
        const Eigen::Vector2d away = (scene.truth[i] - middle).normalized() / 48.0;
        outward += (found.corners_px[i] - scene.truth[i]).dot(away);
        border_outward += (border.corners_px[i] - scene.truth[i]).dot(away);
      }
    }
    EXPECT_LT(border_outward, -0.25) << side;
    EXPECT_LT(std::abs(outward), 0.01) << side;
  }
}

// What does not look like a marker of dark and bright cells is left to the border.
TEST(RefineCorners, AShadowIsNotForTheCells) {
  MarkerPicture scene = render_marker(70.0, 0, {.supersample = 4}, 20.0);
  EXPECT_TRUE(refined(scene.image, scene.truth).by_cells);
  for (int y = 0; y < scene.image.height; ++y) {
    for (int x = 0; x < scene.image.width / 2; ++x) {
      auto& grey = scene.image.pixels[static_cast<std::size_t>(y * scene.image.width + x)];
      grey = static_cast<std::uint8_t>(grey / 2);
    }
  }
  EXPECT_FALSE(refined(scene.image, scene.truth).by_cells);
}

TEST(RefineCorners, MoreNoiseGivesMoreSigma) {
  const MarkerPicture quiet = render_marker(60.0, 1, {.noise = 2.0, .supersample = 6});
  const MarkerPicture loud = render_marker(60.0, 1, {.noise = 8.0, .supersample = 6});
  const RefinedCorners a = refined(quiet.image, quiet.truth);
  const RefinedCorners b = refined(loud.image, loud.truth);
  ASSERT_EQ(a.status, RefineStatus::kDone);
  ASSERT_EQ(b.status, RefineStatus::kDone);
  EXPECT_NEAR(a.noise, 2.0, 0.4);
  EXPECT_NEAR(b.noise, 8.0, 1.6);
  EXPECT_GT(b.sigma_px, 2.0 * a.sigma_px);
  EXPECT_NEAR(a.contrast, 200.0, 10.0);
  // The pixel's own integration adds 1/sqrt(12) to the blur.
  EXPECT_NEAR(a.blur_px, std::hypot(0.7, 1.0 / std::sqrt(12.0)), 0.08);
}

TEST(RefineCorners, AShadowAcrossTheTagDoesNotMoveIt) {
  constexpr double kShadowed = 0.1;  // px; without levels that follow the shadow it is 0.4 px
  for (std::uint64_t salt = 0; salt < 8; ++salt) {
    MarkerPicture scene = render_marker(70.0, salt, {.supersample = 6}, 20.0);
    for (int y = 0; y < scene.image.height; ++y) {
      for (int x = 0; x < scene.image.width; ++x) {
        auto& grey = scene.image.pixels[static_cast<std::size_t>(y * scene.image.width + x)];
        const double light = 0.75 + 0.25 * std::tanh((x + 0.4 * y - 150.0) / 6.0);
        grey = static_cast<std::uint8_t>(std::lround(grey * light));
      }
    }
    const RefinedCorners found = refined(scene.image, scene.truth);
    ASSERT_EQ(found.status, RefineStatus::kDone);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_LT((found.corners_px[i] - scene.truth[i]).norm(), kShadowed) << salt << " " << i;
    }
  }
}

TEST(RefineCorners, SaysWhyItGaveUp) {
  const MarkerPicture scene = render_marker(50.0, 3, {.supersample = 6}, 20.0);
  // Bright inside is expected, and there is none.
  EXPECT_EQ(refined(scene.image, scene.truth, {8, false}).status, RefineStatus::kWrongContrast);
  const GreyImage flat{220, 220, std::vector<std::uint8_t>(220 * 220, 90)};
  EXPECT_EQ(refined(flat, scene.truth).status, RefineStatus::kWrongContrast);
  // Cut by the image's border.
  Corners outside = scene.truth;
  for (Eigen::Vector2d& corner : outside) corner.x() += 150.0;
  EXPECT_NE(refined(scene.image, outside).status, RefineStatus::kDone);
  // All four corners in one place.
  Corners point;
  point.fill({100.0, 100.0});
  const RefinedCorners none = refined(scene.image, point);
  EXPECT_NE(none.status, RefineStatus::kDone);
  EXPECT_EQ(none.corners_px[0], point[0]);
}

}  // namespace
}  // namespace kinescope
