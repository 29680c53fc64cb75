// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/board_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr int kWidth = 480;
constexpr int kHeight = 360;

CameraModel fisheye(double focal_px) {
  CameraModel camera = pinhole_guess(kWidth, kHeight, focal_px);
  camera.fy *= 1.004;
  camera.cx += 4.0;
  camera.cy -= 3.0;
  camera.model = DistortionModel::kEquidistant;
  camera.distortion = {0.03, -0.012, 0.005, -0.001};
  return camera;
}

// A board of 7 x 5 corners, 25 mm apart, `angle` (rad) off the axis and turned at random.
BoardSight view_of(const CameraModel& camera, double angle, double distance_m, Rng& rng) {
  BoardSight view;
  const double about = rng.uniform(0.0, 2.0 * std::numbers::pi);
  const Eigen::Vector3d direction(std::sin(angle) * std::cos(about),
                                  std::sin(angle) * std::sin(about), std::cos(angle));
  const Eigen::Quaterniond facing =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), direction);
  const Eigen::Vector3d tilt(rng.uniform(-0.7, 0.7), rng.uniform(-0.7, 0.7),
                             rng.uniform(-0.5, 0.5));
  const Pose pose{facing * exp_rotation(tilt), distance_m * direction};
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 7; ++column) {
      const Eigen::Vector3d place(0.025 * (column - 3), 0.025 * (row - 2), 0.0);
      const auto pixel = project(camera, pose * place);
      if (!pixel || pixel->x() < 0.0 || pixel->x() > kWidth - 1 || pixel->y() < 0.0 ||
          pixel->y() > kHeight - 1) {
        continue;
      }
      view.pixels.push_back(*pixel);
      view.places_m.push_back(place);
    }
  }
  return view;
}

std::vector<BoardSight> views_of(const CameraModel& camera, Rng& rng) {
  const double rim = std::min(1.4, 0.5 * kWidth / camera.fx);
  std::vector<BoardSight> views;
  while (views.size() < 20) {
    const double share = rng.uniform(0.1, 0.9);
    BoardSight view = view_of(camera, share * rim, 0.1 / std::tan(std::min(0.6, 0.5 * rim)), rng);
    if (view.pixels.size() >= 20) views.push_back(std::move(view));
  }
  return views;
}

const BoardOptions kEquidistantLens{.model = DistortionModel::kEquidistant};

// From a lens that sees 90 degrees off its axis to a narrow one; nobody declares the focal length.
TEST(BoardFit, EquidistantLensOfAnyFocalLength) {
  constexpr double kExact_px = 1e-4;
  for (const double focal_px : {130.0, 160.0, 230.0, 300.0, 420.0, 700.0}) {
    Rng rng = Rng::from_name("equidistant lens");
    const CameraModel truth = fisheye(focal_px);
    const auto found = estimate_intrinsics(views_of(truth, rng), kWidth, kHeight, kEquidistantLens);
    ASSERT_TRUE(found) << focal_px;
    EXPECT_NEAR(found->fx, truth.fx, kExact_px);
    EXPECT_NEAR(found->fy, truth.fy, kExact_px);
    EXPECT_NEAR(found->cx, truth.cx, kExact_px);
    EXPECT_NEAR(found->cy, truth.cy, kExact_px);
    EXPECT_NEAR(found->distortion[0], truth.distortion[0], 1e-4) << focal_px;
  }
}

// A view whose corners were taken for one another.
TEST(BoardFit, EquidistantLensDespiteAMisreadView) {
  constexpr double kClose = 0.05;  // share of the focal length: near enough to tell the view apart
  Rng rng = Rng::from_name("misread view");
  const CameraModel truth = fisheye(160.0);
  std::vector<BoardSight> views = views_of(truth, rng);
  std::ranges::rotate(views[3].pixels, views[3].pixels.begin() + 5);
  const auto found = estimate_intrinsics(views, kWidth, kHeight, kEquidistantLens);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->fx, truth.fx, kClose * truth.fx);
}

// The search for the focal length rests on poses found far off the axis, where x/z grows fast.
TEST(BoardFit, PosesFarOffTheAxis) {
  constexpr double kNoise_px = 0.3;
  Rng rng = Rng::from_name("far off the axis");
  const CameraModel camera = fisheye(130.0);
  int seen = 0;
  for (int i = 0; i < 300; ++i) {
    BoardSight view = view_of(camera, 1.2, 0.25, rng);
    if (view.pixels.size() < 20) continue;
    for (auto& pixel : view.pixels) {
      pixel += Eigen::Vector2d(rng.normal(kNoise_px), rng.normal(kNoise_px));
    }
    ++seen;
    const auto fit = fit_view(camera, view);
    ASSERT_TRUE(fit) << i;
    EXPECT_LT(fit->rms_px, 2.5 * kNoise_px) << i;
  }
  EXPECT_GT(seen, 30);
}

}  // namespace
}  // namespace kinescope
