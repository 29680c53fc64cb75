// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/camera_from_tags.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/core/pose.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr double kNoise = 0.05;  // px

CameraModel lens() {
  CameraModel camera = pinhole_guess(1280, 720, 905.0);
  camera.cx += 12.0;
  camera.cy -= 7.0;
  camera.distortion = {-0.11, 0.05, 0.0, 0.0, 0.0};
  return camera;
}

// Views of a marker of 0.1 m all over the image.
TagObservations views(const CameraModel& camera, double least_tilt, double most_tilt) {
  Rng rng = Rng::from_name("camera from tags");
  MarkerSet markers;
  markers.default_size_m = 0.1;
  TagObservations out;
  out.width = camera.width;
  out.height = camera.height;
  for (int frame = 0; frame < 400; ++frame) {
    out.times_s.push_back(frame);
    const double direction = rng.uniform(0.0, 6.28);
    const double tilt = rng.uniform(least_tilt, most_tilt);
    Pose view;
    view.rotation = exp_rotation({tilt * std::cos(direction), tilt * std::sin(direction), 0.0}) *
                    exp_rotation({0.0, 0.0, rng.uniform(-3.0, 3.0)});
    const double away = rng.uniform(0.6, 1.2);
    view.translation << rng.uniform(-0.6, 0.6) * away, rng.uniform(-0.33, 0.33) * away, away;
    TagObservation seen;
    seen.frame = frame;
    seen.id = TagId{1};
    seen.sigma_px = kNoise;
    for (const Eigen::Vector3d& corner : markers.corners_m(seen.id)) {
      const Eigen::Vector2d pixel = *project(camera, view * corner);
      seen.corners_px.push_back(pixel + Eigen::Vector2d(rng.normal(kNoise), rng.normal(kNoise)));
    }
    out.observations.push_back(std::move(seen));
  }
  return out;
}

MarkerSet one_size() {
  MarkerSet markers;
  markers.default_size_m = 0.1;
  return markers;
}

// A per mille of the focal length and a few pixels at the centre are about three times what 400
// views of this noise leave open.
TEST(CameraFromTags, LensAndCentreShowInTheMarkersShapes) {
  const CameraModel truth = lens();
  const CameraModel found = camera_from_tags(views(truth, 0.2, 1.0), one_size());
  EXPECT_EQ(found.width, truth.width);
  EXPECT_DOUBLE_EQ(found.fx, found.fy);
  EXPECT_NEAR(found.fx, truth.fx, 3.0);
  EXPECT_NEAR(found.cx, truth.cx, 4.0);
  EXPECT_NEAR(found.cy, truth.cy, 4.0);
  EXPECT_NEAR(found.distortion[0], truth.distortion[0], 0.01);
  // What the lens does near the image's corner.
  const Eigen::Vector3d corner(0.6, 0.33, 1.0);
  EXPECT_LT((*project(found, corner) - *project(truth, corner)).norm(), 3.0);
}

TEST(CameraFromTags, ShapesSpeakForTheCameraThatTheyAreOfWhateverTheMarkersMeasure) {
  const CameraModel truth = lens();
  const TagObservations seen = views(truth, 0.2, 1.0);
  CameraModel zoomed = truth;
  zoomed.fx = zoomed.fy = 1.1 * truth.fx;
  const double odds = log_odds_of_shapes(truth, zoomed, seen, one_size());
  // A tenth of the focal length: half of the noise in each of 400 views is 35.
  EXPECT_GT(odds, 100.0);
  EXPECT_DOUBLE_EQ(log_odds_of_shapes(zoomed, truth, seen, one_size()), -odds);
  EXPECT_EQ(log_odds_of_shapes(truth, truth, seen, one_size()), 0.0);
  MarkerSet twice;
  twice.default_size_m = 0.2;
  EXPECT_NEAR(log_odds_of_shapes(truth, zoomed, seen, twice), odds, 1e-3 * odds);
}

TEST(CameraFromTags, MarkersSeenFaceOnShowNoFocalLength) {
  TagObservations flat;
  flat.width = 1280;
  flat.height = 720;
  flat.times_s = {0.0};
  TagObservation seen;
  seen.id = TagId{1};
  seen.sigma_px = kNoise;
  seen.corners_px = {{600.0, 400.0}, {700.0, 400.0}, {700.0, 300.0}, {600.0, 300.0}};
  flat.observations = {seen};
  EXPECT_THROW(static_cast<void>(camera_from_tags(flat, one_size())), Error);
}

}  // namespace
}  // namespace kinescope
