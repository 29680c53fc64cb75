// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>

#include "calib/tracks/pose_tracks_from_tags.h"
#include "calib/tracks/several_cameras.h"
#include "tests/truth/rig_world.h"

namespace kinescope {
namespace {

using truth::RigCamera;
using truth::RigOptions;
using truth::World;

RigOptions rig(std::vector<RigCamera> cameras) {
  RigOptions out;
  out.robot.seed = 5;
  out.robot.duration_s = 8.0;
  out.robot.tag_size_m = 0.08;
  out.cameras = std::move(cameras);
  return out;
}

std::vector<PoseTracks> tracks_of(const std::vector<World>& worlds) {
  std::vector<PoseTracks> out;
  for (const World& world : worlds) {
    TagObservations tags;
    tags.times_s = world.measurements.times_s;
    tags.width = world.camera.width;
    tags.height = world.camera.height;
    tags.observations = world.measurements.corners;
    out.push_back(pose_tracks_from_tags(tags, world.camera, world.markers));
  }
  return out;
}

TEST(PlaceCameras, FindsPosesAndClocksByMovingMarkers) {
  const auto worlds = truth::make_rig_worlds(
      rig({{.name = "a"},
           {.name = "b", .azimuth_rad = 0.5, .clock_s = 0.7, .rate_hz = 20.0},
           {.name = "c", .azimuth_rad = 1.0, .clock_s = -0.9}}));
  const PlacedCameras placed = place_cameras(tracks_of(worlds), worlds.front().markers);
  const CameraPlace& origin = placed.places[placed.reference].value();
  EXPECT_EQ(origin.ahead_s, 0.0);
  const double clocks_s[] = {0.0, 0.7, -0.9};
  for (std::size_t c = 0; c < worlds.size(); ++c) {
    ASSERT_TRUE(placed.places[c].has_value());
    const CameraPlace& place = *placed.places[c];
    EXPECT_TRUE(place.clock_known);
    // A start for the bundle, of poses that are right to millimetres.
    EXPECT_NEAR(place.ahead_s, clocks_s[c] - clocks_s[placed.reference], 5e-3);
    const Pose truth = worlds[placed.reference].T_camera_base * worlds[c].T_camera_base.inverse();
    const Vector6d off = log_pose(truth.inverse() * place.T_reference_camera);
    EXPECT_LT(off.head<3>().norm(), 0.01);
    EXPECT_LT(off.tail<3>().norm(), 0.015);
  }
}

// Beyond the scan for clocks that nearly agree some wrong offset meets better than most.
TEST(PlaceCameras, FindsAClockThatIsSecondsOff) {
  const auto worlds = truth::make_rig_worlds(
      rig({{.name = "a"}, {.name = "b", .azimuth_rad = 0.5, .clock_s = 3.2}}));
  const PlacedCameras placed = place_cameras(tracks_of(worlds), worlds.front().markers);
  const std::size_t other = 1 - placed.reference;
  ASSERT_TRUE(placed.places[other].has_value());
  EXPECT_TRUE(placed.places[other]->clock_known);
  EXPECT_NEAR(placed.places[other]->ahead_s, other == 1 ? 3.2 : -3.2, 5e-3);
}

TEST(PlaceCameras, LeavesOutACameraWithoutACommonMarker) {
  auto worlds = truth::make_rig_worlds(rig({{.name = "a"}, {.name = "b", .azimuth_rad = 0.5}}));
  for (TagObservation& tag : worlds[1].measurements.corners) tag.id.value += 100;
  const PlacedCameras placed = place_cameras(tracks_of(worlds), worlds.front().markers);
  EXPECT_TRUE(placed.places[placed.reference].has_value());
  EXPECT_FALSE(placed.places[1 - placed.reference].has_value());
}

TEST(MergeFrames, OrdersByTimeThenCamera) {
  const CommonFrames frames = merge_frames({{0.0, 0.2, 0.4}, {0.1, 0.2}});
  EXPECT_EQ(frames.times_s, (std::vector<double>{0.0, 0.1, 0.2, 0.2, 0.4}));
  EXPECT_EQ(frames.camera_of_frame, (std::vector<int>{0, 1, 0, 1, 0}));
  EXPECT_EQ(frames.frame_of[1], (std::vector<int>{1, 3}));
}

// What the second camera saw is carried to the first one's times, over no long gap.
TEST(AtCommonInstants, InterpolatesBetweenFramesOfTheOtherCamera) {
  const std::vector<double> times_s{0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 1.0};
  const std::vector<int> camera{0, 1, 0, 1, 0, 1, 0, 0};
  PoseTracks tracks;
  tracks.times_s = times_s;
  PoseTrack track{TagId{7}, {}};
  for (std::size_t f = 0; f < times_s.size(); ++f) {
    if (camera[f] == 0) continue;
    PoseSample sample;
    sample.frame = static_cast<int>(f);
    sample.T_camera_marker.translation = Eigen::Vector3d(times_s[f], 0.0, 1.0);
    track.samples.push_back(sample);
  }
  tracks.tracks.push_back(track);
  const PoseTracks found = at_common_instants(tracks, camera);
  EXPECT_EQ(found.times_s, (std::vector<double>{0.0, 0.1, 0.2, 0.3, 1.0}));
  ASSERT_EQ(found.tracks.size(), 1U);
  // 0.0 and 0.3 are outside of what it saw.
  ASSERT_EQ(found.tracks[0].samples.size(), 2U);
  for (const PoseSample& sample : found.tracks[0].samples) {
    const double t = found.times_s[static_cast<std::size_t>(sample.frame)];
    EXPECT_NEAR(sample.T_camera_marker.translation.x(), t, 1e-12);
    // Of two samples half way between them.
    EXPECT_NEAR(sample.covariance(0, 0), 0.5, 1e-9);
  }
}

}  // namespace
}  // namespace kinescope
