// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/camera_model.h"

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

// Central differences with step h are exact to h^2; pixels are of order 1000.
constexpr double kStep = 1e-6;
constexpr double kDerivativeTolerance = 1e-4;  // px per unit, on derivatives of order 1000
constexpr double kRoundTripTolerance = 1e-10;  // normalised units

CameraModel random_camera(DistortionModel model, Rng& rng) {
  CameraModel camera = pinhole_guess(1280, 720, 900.0);
  camera.fy = 910.0;
  camera.model = model;
  for (int i = 0; i < distortion_count(model); ++i) {
    camera.distortion[static_cast<std::size_t>(i)] = rng.uniform(-0.02, 0.02);
  }
  return camera;
}

class EveryModel : public testing::TestWithParam<DistortionModel> {};

TEST_P(EveryModel, DerivativesAgreeWithDifferences) {
  Rng rng = Rng::from_name("camera derivatives");
  for (int trial = 0; trial < 50; ++trial) {
    const CameraModel camera = random_camera(GetParam(), rng);
    const Eigen::Vector3d p(rng.uniform(-0.6, 0.6), rng.uniform(-0.4, 0.4), rng.uniform(0.8, 2.0));
    const auto exact = project_with_derivatives(camera, p);
    ASSERT_TRUE(exact);
    EXPECT_EQ(exact->pixel, *project(camera, p));
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d h = kStep * Eigen::Vector3d::Unit(axis);
      const Eigen::Vector2d slope =
          (*project(camera, p + h) - *project(camera, p - h)) / (2.0 * kStep);
      EXPECT_LT((slope - exact->d_point.col(axis)).norm(), kDerivativeTolerance) << axis;
    }
    for (int k = 0; k < 4 + distortion_count(GetParam()); ++k) {
      const auto shifted = [&](double h) {
        CameraModel other = camera;
        if (k == 0) other.fx += h;
        if (k == 1) other.fy += h;
        if (k == 2) other.cx += h;
        if (k == 3) other.cy += h;
        if (k > 3) other.distortion[static_cast<std::size_t>(k - 4)] += h;
        return *project(other, p);
      };
      const Eigen::Vector2d slope = (shifted(kStep) - shifted(-kStep)) / (2.0 * kStep);
      EXPECT_LT((slope - exact->d_intrinsics.col(k)).norm(), kDerivativeTolerance) << k;
    }
  }
}

TEST_P(EveryModel, UnprojectUndoesProject) {
  Rng rng = Rng::from_name("camera round trip");
  for (int trial = 0; trial < 200; ++trial) {
    const CameraModel camera = random_camera(GetParam(), rng);
    const Eigen::Vector2d xy(rng.uniform(-0.7, 0.7), rng.uniform(-0.4, 0.4));
    const auto back = unproject(camera, *project(camera, {2.0 * xy.x(), 2.0 * xy.y(), 2.0}));
    ASSERT_TRUE(back);
    EXPECT_LT((*back - xy).norm(), kRoundTripTolerance);
  }
}

INSTANTIATE_TEST_SUITE_P(Models, EveryModel,
                         testing::Values(DistortionModel::kPlumbBob,
                                         DistortionModel::kRationalPolynomial,
                                         DistortionModel::kEquidistant));

TEST(CameraModel, AxesAreRightDownForward) {
  const CameraModel camera = pinhole_guess(101, 51, 100.0);
  EXPECT_EQ(*project(camera, {0.0, 0.0, 1.0}), Eigen::Vector2d(50.0, 25.0));
  EXPECT_EQ(*project(camera, {0.1, 0.0, 1.0}), Eigen::Vector2d(60.0, 25.0));
  EXPECT_EQ(*project(camera, {0.0, 0.1, 1.0}), Eigen::Vector2d(50.0, 35.0));
}

TEST(CameraModel, NothingBehindTheCamera) {
  const CameraModel camera = pinhole_guess(101, 51, 100.0);
  EXPECT_FALSE(project(camera, {0.0, 0.0, -1.0}));
  EXPECT_FALSE(project(camera, {0.0, 0.0, 0.0}));
  EXPECT_FALSE(project_with_derivatives(camera, {0.1, 0.0, std::nan("")}));
}

TEST(CameraModel, UnprojectRefusesTheFieldBeyondTheFold) {
  CameraModel camera = pinhole_guess(1000, 1000, 300.0);
  camera.distortion[0] = -0.5;  // r (1 - 0.5 r^2) has its largest value 0.54 at r = 0.82
  EXPECT_FALSE(unproject(camera, {camera.cx + 300.0 * 0.9, camera.cy}));
}

}  // namespace
}  // namespace kinescope
