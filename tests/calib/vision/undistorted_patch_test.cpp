// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/undistorted_patch.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

CameraModel wide_lens() {
  CameraModel lens = pinhole_guess(1280, 720, 800.0);
  lens.model = DistortionModel::kPlumbBob;
  lens.distortion[0] = -0.3;
  lens.distortion[1] = 0.1;
  lens.distortion[2] = 0.001;
  return lens;
}

TEST(UndistortedPatch, IsExactBetweenItsNodes) {
  constexpr double kExact = 2e-3;  // px
  const CameraModel lens = wide_lens();
  const Eigen::AlignedBox2d box(Eigen::Vector2d(1050.0, 550.0), Eigen::Vector2d(1150.0, 640.0));
  const auto patch = UndistortedPatch::over(lens, box);
  ASSERT_TRUE(patch);
  for (int y = 550; y <= 640; y += 6) {
    const UndistortedPatch::Row row = patch->row(y);
    for (int x = 1050; x <= 1150; x += 5) {
      const auto ray = unproject(lens, {x, y});
      ASSERT_TRUE(ray);
      const Eigen::Vector2d expected(lens.fx * ray->x() + lens.cx, lens.fy * ray->y() + lens.cy);
      EXPECT_LT((row.at(x) - expected).norm(), kExact) << x << " " << y;
      const auto back = distorted(lens, row.at(x));
      ASSERT_TRUE(back);
      EXPECT_LT((*back - Eigen::Vector2d(x, y)).norm(), kExact) << x << " " << y;
    }
  }
}

TEST(UndistortedPatch, IsNothingWhereTheLensShowsNothing) {
  CameraModel lens = wide_lens();
  lens.distortion[0] = -1.0;  // folds back on itself
  lens.distortion[1] = 0.0;
  const Eigen::AlignedBox2d box(Eigen::Vector2d(1150.0, 600.0), Eigen::Vector2d(1270.0, 710.0));
  EXPECT_FALSE(UndistortedPatch::over(lens, box));
}

}  // namespace
}  // namespace kinescope
