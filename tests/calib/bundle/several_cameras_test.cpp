// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/several_cameras.h"

#include <cmath>

#include <gtest/gtest.h>

#include "calib/bundle/calibrate.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "tests/truth/rig_world.h"

namespace kinescope {
namespace {

using truth::RigOptions;
using truth::World;

constexpr double kLag = 0.012;  // s, of the second camera's clock beyond what its start says

RigOptions two_cameras(std::uint64_t seed) {
  RigOptions out;
  out.robot.seed = seed;
  out.robot.duration_s = 6.0;
  out.robot.tag_size_m = 0.08;
  out.cameras = {{.name = "front", .rate_hz = 10.0},
                 {.name = "left", .azimuth_rad = 0.7, .clock_s = kLag, .rate_hz = 8.0}};
  return out;
}

// Frames of all worlds as one sequence.
Measurements together(const std::vector<World>& worlds) {
  std::vector<std::vector<double>> times_s;
  for (const World& world : worlds) times_s.push_back(world.measurements.times_s);
  const CommonFrames frames = merge_frames(times_s);
  Measurements out;
  out.times_s = frames.times_s;
  out.camera_of_frame = frames.camera_of_frame;
  for (std::size_t c = 0; c < worlds.size(); ++c) {
    for (TagObservation tag : worlds[c].measurements.corners) {
      tag.frame = frames.frame_of[c][static_cast<std::size_t>(tag.frame)];
      out.corners.push_back(std::move(tag));
    }
  }
  return out;
}

CalibrationStart start_of(const std::vector<World>& worlds, std::uint64_t seed) {
  constexpr double kOff = 0.003;  // rad, m
  CalibrationStart start = truth::perturbed_start(worlds.front(), kOff, kOff, seed);
  Rng rng = Rng::from_name("start of further cameras", seed);
  start.camera_name = "front";
  for (std::size_t c = 1; c < worlds.size(); ++c) {
    start.further_cameras.push_back(
        {"left", worlds[c].T_camera_base * Pose{exp_rotation(rng.normal3(kOff)), rng.normal3(kOff)},
         worlds[c].camera, 0.0, false});
  }
  return start;
}

Calibration calibrated(const std::vector<World>& worlds, std::uint64_t seed) {
  CalibrateOptions options;
  options.folds = 2;
  const World& first = worlds.front();
  return calibrate(worlds.size() > 1 ? together(worlds) : first.measurements, first.markers,
                   first.log, start_of(worlds, seed), options);
}

TEST(SeveralCameras, AreFoundWithPoseAndClock) {
  const std::vector<World> worlds = truth::make_rig_worlds(two_cameras(1));
  const Calibration found = calibrated(worlds, 1);
  ASSERT_EQ(found.status, CalibrationStatus::kConverged);
  ASSERT_EQ(found.cameras(), 2U);
  const CameraEstimate& left = found.further_cameras.front();
  const double sigma_s = value_of(left.lag_sigma_s);
  EXPECT_NEAR(found.time_offset_s + left.lag_s, kLag, 4.0 * sigma_s);
  EXPECT_LT(sigma_s, 1e-3);
  // The base is where its first marker is, which the tree of the truth may have elsewhere.
  const Pose T_found_truth = found.tree.markers.front().T_link_marker *
                             worlds[1].tree.markers.front().T_link_marker.inverse();
  const Vector6d off =
      log_pose((found.T_camera_base_of(1) * T_found_truth).inverse() * worlds[1].T_camera_base);
  EXPECT_LT(off.head<3>().norm(), 4.0 * value_of(left.rotation_sigma_rad));
  EXPECT_LT(off.tail<3>().norm(), 4.0 * value_of(left.translation_sigma_m));
  const std::vector<CameraErrors> errors = errors_of_cameras(found);
  for (const CameraErrors& camera : errors) {
    EXPECT_GT(camera.used, 50);
    // Two coordinates of 0.1 px.
    EXPECT_NEAR(camera.held_out_rms, 0.1 * std::sqrt(2.0), 0.02);
  }
}

TEST(SeveralCameras, TogetherClaimLessThanEachAlone) {
  const std::vector<World> worlds = truth::make_rig_worlds(two_cameras(2));
  const Calibration together = calibrated(worlds, 2);
  for (const World& world : worlds) {
    const Calibration alone = calibrated({world}, 2);
    for (std::size_t j = 0; j < together.joints.size(); ++j) {
      EXPECT_LT(value_of(together.joints[j].among_direction_sigma_rad),
                value_of(alone.joints[j].among_direction_sigma_rad))
          << "joint " << j;
    }
  }
}

// The lag of the second camera and the offset of the first over many recordings: their errors are
// what the covariance claims.
TEST(SeveralCameras, ScatterAsTheyClaim) {
  constexpr int kRecordings = 60;
  double squares = 0.0;
  int within = 0, count = 0;
  for (int k = 0; k < kRecordings; ++k) {
    const auto seed = static_cast<std::uint64_t>(100 + k);
    const Calibration found = calibrated(truth::make_rig_worlds(two_cameras(seed)), seed);
    if (found.status != CalibrationStatus::kConverged) continue;
    const CameraEstimate& left = found.further_cameras.front();
    for (const double z : {(left.lag_s - kLag) / value_of(left.lag_sigma_s),
                           found.time_offset_s / value_of(found.time_offset_sigma_s)}) {
      squares += z * z;
      within += std::abs(z) < 2.0;
      ++count;
    }
  }
  ASSERT_GT(count, kRecordings);
  // Chi-square over `count` values: mean 1, standard deviation sqrt(2 / count) = 0.13; claims are
  // widened for noise that lasts, and may be too large by a third.
  EXPECT_GT(squares / count, 0.5);
  EXPECT_LT(squares / count, 1.4);
  EXPECT_GT(within, 0.9 * count);
}

}  // namespace
}  // namespace kinescope
