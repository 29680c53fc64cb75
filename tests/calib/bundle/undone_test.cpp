// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/undone.h"

#include <gtest/gtest.h>

#include "tests/truth/camera_world.h"

namespace kinescope {
namespace {

// A camera that shifts in the middle, as a calibration with that correction: what its tracks would
// have been without.
TEST(Undone, TracksOfABumpedCameraAreThoseOfOneThatStoodStill) {
  truth::WorldOptions options;
  options.sigma_px = 0.0;
  const truth::World world = truth::make_world(options);
  const Pose bump{exp_rotation({0.0, 0.01, 0.0}), {0.005, 0.0, 0.0}};
  Calibration calibration;
  calibration.kind = MeasurementKind::kPose;
  calibration.tree = world.tree;
  calibration.T_camera_base = world.T_camera_base;
  calibration.joint_values = world.joint_values;
  calibration.times_s = world.measurements.times_s;
  PoseTracks seen;
  seen.times_s = world.measurements.times_s;
  PoseTracks truth = seen;
  const int frames = static_cast<int>(seen.times_s.size());
  for (const Marker& marker : world.tree.markers) {
    PoseTrack bumped{marker.id, {}};
    PoseTrack still{marker.id, {}};
    for (int f = 0; f < frames; ++f) {
      const auto links = forward_kinematics(world.tree, world.joint_values.row(f));
      PoseSample sample;
      sample.frame = f;
      sample.T_camera_marker =
          world.T_camera_base * links[marker.link.index()] * marker.T_link_marker;
      sample.T_camera_marker_alternative = sample.T_camera_marker;
      SightingResidual residual;  // nothing is left of a model with the effect in it
      residual.frame = f;
      residual.id = marker.id;
      residual.used = f != 3;
      calibration.residuals.push_back(residual);
      if (residual.used) still.samples.push_back(sample);
      if (f > frames / 2) sample.T_camera_marker = bump * sample.T_camera_marker;
      bumped.samples.push_back(sample);
    }
    seen.tracks.push_back(bumped);
    truth.tracks.push_back(still);
  }
  const PoseTracks undone = with_effects_undone(calibration, seen);
  ASSERT_EQ(undone.tracks.size(), truth.tracks.size());
  for (std::size_t t = 0; t < truth.tracks.size(); ++t) {
    const auto& a = undone.tracks[t].samples;
    const auto& b = truth.tracks[t].samples;
    ASSERT_EQ(a.size(), b.size()) << "a sighting that was left out says nothing";
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i].frame, b[i].frame);
      EXPECT_LT((a[i].T_camera_marker.translation - b[i].T_camera_marker.translation).norm(),
                1e-12);
      EXPECT_FALSE(a[i].T_camera_marker_alternative);
    }
  }
}

// A lens that is not as declared turns what the camera sees of a marker; what a sighting leaves
// open lies along the line of sight all the same.
TEST(Undone, WhatACameraLeavesOpenStaysAlongItsLineOfSight) {
  truth::WorldOptions options;
  options.sigma_px = 0.0;
  const truth::World world = truth::make_world(options);
  const Marker& marker = world.tree.markers.front();
  const auto links = forward_kinematics(world.tree, world.joint_values.row(0));
  const Pose T_camera_marker =
      world.T_camera_base * links[marker.link.index()] * marker.T_link_marker;
  Calibration calibration;
  calibration.kind = MeasurementKind::kCorners;
  calibration.tree = world.tree;
  calibration.T_camera_base = world.T_camera_base;
  calibration.joint_values = world.joint_values;
  calibration.times_s = world.measurements.times_s;
  SightingResidual residual;
  residual.id = marker.id;
  residual.used = true;
  calibration.residuals = {residual};
  PoseSample sample;
  sample.T_camera_marker = T_camera_marker * Pose{exp_rotation({0.1, -0.2, 0.0}), {0.0, 0.0, 0.0}};
  const Eigen::Vector3d camera_variances(1e-10, 1e-10, 1e-6);
  const Eigen::Matrix3d R_before = sample.T_camera_marker.matrix3();
  sample.covariance.bottomRightCorner<3, 3>() =
      R_before.transpose() * camera_variances.asDiagonal() * R_before;
  const PoseTracks undone =
      with_effects_undone(calibration, {{0.0}, {PoseTrack{marker.id, {sample}}}});
  ASSERT_EQ(undone.tracks.front().samples.size(), 1U);
  const PoseSample& now = undone.tracks.front().samples.front();
  const Eigen::Matrix3d R = now.T_camera_marker.matrix3();
  const Eigen::Matrix3d in_camera = R * now.covariance.bottomRightCorner<3, 3>() * R.transpose();
  EXPECT_LT((in_camera - Eigen::Matrix3d(camera_variances.asDiagonal())).norm(), 1e-15);
}

// Seen by a camera whose centre is not the declared one, as the declared one would have seen it.
TEST(Undone, CornersAreThoseOfTheDeclaredCamera) {
  truth::WorldOptions options;
  options.sigma_px = 0.0;
  const truth::World world = truth::make_world(options);
  Calibration calibration;
  calibration.kind = MeasurementKind::kCorners;
  calibration.tree = world.tree;
  calibration.T_camera_base = world.T_camera_base;
  calibration.camera = world.camera;
  calibration.joint_values = world.joint_values;
  calibration.times_s = world.measurements.times_s;
  const Eigen::Vector2d left(0.3, -0.2);  // px, of the model with the effect
  const Eigen::Vector2d shift(40.0, 0.0);
  TagObservations seen;
  seen.times_s = world.measurements.times_s;
  for (const TagObservation& corners : world.measurements.corners) {
    TagObservation tag;
    tag.frame = corners.frame;
    tag.id = corners.id;
    for (const Eigen::Vector2d& corner : corners.corners_px)
      tag.corners_px.push_back(corner + shift + left);
    seen.observations.push_back(tag);
    SightingResidual residual;
    residual.frame = corners.frame;
    residual.id = corners.id;
    residual.used = corners.frame != 3;
    residual.corners_px.assign(corners.corners_px.size(), left);
    calibration.residuals.push_back(residual);
  }
  const TagObservations undone = with_effects_undone(calibration, world.markers, seen);
  std::size_t next = 0;
  for (const TagObservation& corners : world.measurements.corners) {
    if (corners.frame == 3) continue;
    ASSERT_LT(next, undone.observations.size());
    const TagObservation& tag = undone.observations[next++];
    ASSERT_EQ(tag.frame, corners.frame);
    for (std::size_t i = 0; i < corners.corners_px.size(); ++i)
      EXPECT_LT((tag.corners_px[i] - corners.corners_px[i] - left).norm(), 1e-9);
  }
  EXPECT_EQ(next, undone.observations.size()) << "a sighting that was left out says nothing";
}

TEST(Undone, MarkersThatAreNotOnTheRobotStayAsTheyAre) {
  PoseTracks tracks;
  tracks.times_s = {0.0};
  tracks.tracks = {{TagId{99}, {PoseSample{}}}};
  const PoseTracks undone = with_effects_undone(Calibration{}, tracks);
  ASSERT_EQ(undone.tracks.size(), 1U);
  EXPECT_EQ(undone.tracks[0].samples.size(), 1U);
  TagObservations tags;
  tags.observations = {{0, TagId{99}, {}}};
  EXPECT_EQ(with_effects_undone(Calibration{}, MarkerSet{}, tags).observations.size(), 1U);
}

}  // namespace
}  // namespace kinescope
