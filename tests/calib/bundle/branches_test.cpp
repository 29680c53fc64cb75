// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/branches.h"

#include <algorithm>
#include <numbers>

#include <gtest/gtest.h>

#include "calib/tracks/pose_tracks_from_tags.h"
#include "kinematics/structure/structure.h"
#include "tests/truth/camera_world.h"

namespace kinescope {
namespace {

// Branches as far from the truth as each other are both wrong, or none (rad).
constexpr double kTie = std::numbers::pi / 180.0;

// Six joints with tags of 20 px on poor pictures, the one at rest nearly face on.
truth::World small_tags() {
  truth::WorldOptions options;
  options.seed = 12;
  options.joints = {JointType::kRevolute, JointType::kRevolute, JointType::kPrismatic,
                    JointType::kRevolute, JointType::kRevolute, JointType::kRevolute};
  options.frames = 300;
  options.tag_size_m = 20.0 * 1.3 / 900.0;
  options.sigma_px = 0.188 / std::numbers::sqrt2;
  return truth::make_world(options);
}

PoseTracks tracks_of(const truth::World& world) {
  const TagObservations seen{.times_s = world.measurements.times_s,
                             .width = world.camera.width,
                             .height = world.camera.height,
                             .observations = world.measurements.corners,
                             .rejected = {},
                             .warnings = {}};
  return pose_tracks_from_tags(seen, world.camera, world.markers);
}

// Sightings whose first branch is the further one from the truth.
int wrong_in(const PoseTracks& tracks, const truth::World& world) {
  int wrong = 0;
  for (const PoseTrack& track : tracks.tracks) {
    const auto marker = std::ranges::find(world.tree.markers, track.id, &Marker::id);
    for (const PoseSample& s : track.samples) {
      if (!s.T_camera_marker_alternative) continue;
      const auto links = forward_kinematics(world.tree, world.joint_values.row(s.frame));
      const Pose truth = world.T_camera_base * links[marker->link.index()] * marker->T_link_marker;
      const double first = angle_between(s.T_camera_marker.rotation, truth.rotation);
      const double other = angle_between(s.T_camera_marker_alternative->rotation, truth.rotation);
      wrong += first > other + kTie ? 1 : 0;
    }
  }
  return wrong;
}

Calibration as_it_is(const truth::World& world) {
  Calibration calibration;
  calibration.status = CalibrationStatus::kConverged;
  calibration.tree = world.tree;
  calibration.T_camera_base = world.T_camera_base;
  calibration.joint_values = world.joint_values;
  return calibration;
}

TEST(Branches, AreThoseThatTheRobotShows) {
  const truth::World world = small_tags();
  const PoseTracks tracks = tracks_of(world);
  EXPECT_GT(wrong_in(tracks, world), 5);
  const PoseTracks chosen = with_branches_of(as_it_is(world), tracks);
  EXPECT_EQ(wrong_in(chosen, world), 0);
  ASSERT_EQ(chosen.tracks.size(), tracks.tracks.size());
  for (std::size_t t = 0; t < tracks.tracks.size(); ++t) {
    for (std::size_t i = 0; i < tracks.tracks[t].samples.size(); ++i) {
      const PoseSample& was = tracks.tracks[t].samples[i];
      const PoseSample& is = chosen.tracks[t].samples[i];
      const auto quaternion = [](const Pose& pose) { return pose.rotation.coeffs(); };
      if (quaternion(is.T_camera_marker) == quaternion(was.T_camera_marker)) continue;
      EXPECT_EQ(quaternion(is.T_camera_marker), quaternion(*was.T_camera_marker_alternative));
      EXPECT_EQ(is.covariance, *was.alternative_covariance);
      EXPECT_EQ(is.alternative_cost, -was.alternative_cost);
    }
  }
}

TEST(Branches, StayWhereNoCalibrationTells) {
  const truth::World world = small_tags();
  const PoseTracks tracks = tracks_of(world);
  Calibration calibration = as_it_is(world);
  calibration.status = CalibrationStatus::kNotConverged;
  EXPECT_EQ(wrong_in(with_branches_of(calibration, tracks), world), wrong_in(tracks, world));
}

TEST(Branches, DoNotMisleadTheStructure) {
  const truth::World world = small_tags();
  const Structure found = find_structure(tracks_of(world), world.log);
  EXPECT_TRUE(found.free_markers.empty());
  ASSERT_EQ(found.joints.size(), world.tree.joints.size());
  ASSERT_EQ(found.links[0].markers.size(), 1U);
  EXPECT_EQ(found.links[0].markers[0], world.tree.markers[0].id);
  for (std::size_t j = 0; j < found.joints.size(); ++j) {
    EXPECT_EQ(found.joints[j].type, world.tree.joints[j].type);
    ASSERT_TRUE(found.joints[j].channel);
    EXPECT_EQ(found.joints[j].channel->channel, static_cast<int>(j));
  }
}

}  // namespace
}  // namespace kinescope
