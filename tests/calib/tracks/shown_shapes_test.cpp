// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/shown_shapes.h"

#include <cmath>

#include <gtest/gtest.h>

#include "calib/tracks/pose_tracks_from_tags.h"
#include "kinematics/core/pose.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kCornerNoise = 0.05;  // px
constexpr double kEdge = 0.06;         // m

CameraModel shapes_camera() { return pinhole_guess(1280, 720, 905.0); }

MarkerSet shapes_markers() {
  MarkerSet out;
  out.default_size_m = kEdge;
  return out;
}

// Views of marker 1, which has this shape, and of marker 2, which is flat; marker 3 is at rest.
TagObservations shapes_views(const MarkerShape& shape, double most_tilt) {
  Rng rng = Rng::from_name("shown shapes");
  const CameraModel camera = shapes_camera();
  TagObservations out;
  out.width = camera.width;
  out.height = camera.height;
  Pose at_rest;
  at_rest.rotation = exp_rotation({0.5, 0.3, 0.1});
  at_rest.translation << 0.2, 0.1, 0.8;
  for (int frame = 0; frame < 300; ++frame) {
    out.times_s.push_back(frame);
    for (const int id : {1, 2, 3}) {
      Pose view = at_rest;
      if (id < 3) {
        const double direction = rng.uniform(0.0, 6.28), tilt = rng.uniform(0.0, most_tilt);
        view.rotation =
            exp_rotation({tilt * std::cos(direction), tilt * std::sin(direction), 0.0}) *
            exp_rotation({0.0, 0.0, rng.uniform(-3.0, 3.0)});
        view.translation << rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2), rng.uniform(0.6, 1.0);
      }
      TagObservation& seen = out.observations.emplace_back();
      seen.frame = frame;
      seen.id = TagId{id};
      seen.sigma_px = kCornerNoise;
      for (const Eigen::Vector3d& corner : square_corners(kEdge)) {
        const Eigen::Vector2d pixel =
            *project(camera, view * (id == 1 ? shape.corner_m(corner) : corner));
        seen.corners_px.push_back(
            pixel + Eigen::Vector2d(rng.normal(kCornerNoise), rng.normal(kCornerNoise)));
      }
    }
  }
  return out;
}

TEST(ShownShapes, ABentMarkerIsTheOnlyOneThatIsNotFlat) {
  for (const double warp_m : {2.5e-3, -1e-3}) {
    const MarkerShape bent{1.0, 0.01, -0.005, warp_m};
    const auto shown = shown_shapes(shapes_camera(), shapes_views(bent, 0.9), shapes_markers());
    ASSERT_EQ(shown.size(), 3u);
    EXPECT_GT(shown[0].log_odds, 50.0);
    EXPECT_NEAR(shown[0].shape.warp_m, warp_m, 0.1e-3);
    EXPECT_NEAR(shown[0].shape.width, bent.width, 2e-3);
    EXPECT_NEAR(shown[0].shape.shear, bent.shear, 2e-3);
    EXPECT_LT(shown[1].log_odds, 0.0);
    EXPECT_LT(shown[2].log_odds, 0.0);
  }
}

// Seen from before, the planar branches of a bent marker are exchanged where it is taken for flat
// (`undeclared`, 11063).
TEST(ShownShapes, AMarkerBentSoFarThatItsBranchesAreExchangedIsFound) {
  const MarkerShape bent{1.0, 0.0, 0.0, -2.5e-3};
  const auto shown = shown_shapes(shapes_camera(), shapes_views(bent, 0.3), shapes_markers());
  ASSERT_FALSE(shown.empty());
  EXPECT_NEAR(shown[0].shape.warp_m, bent.warp_m, 0.1e-3);
}

TEST(ShownShapes, TheScaleIsOfWhatNoPoseTakes) {
  const double scale = scale_of_shapes(shapes_camera(), shapes_views({}, 0.9), shapes_markers());
  // Of normal noise in two coordinates, the best scale of a t with 4 degrees of freedom is 0.83.
  EXPECT_NEAR(scale, 0.83 * kCornerNoise, 0.05 * kCornerNoise);
  EXPECT_EQ(scale_of_shapes(shapes_camera(), {}, shapes_markers()), 0.0);
}

}  // namespace
}  // namespace kinescope
