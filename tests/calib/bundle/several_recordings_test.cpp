// SPDX-License-Identifier: Apache-2.0
//
// Recordings of one robot, one after the other, in one bundle.
#include <cmath>

#include <gtest/gtest.h>

#include "calib/bundle/calibrate.h"
#include "calib/bundle/place_recording.h"
#include "kinematics/core/error.h"
#include "tests/truth/axis_errors.h"
#include "tests/truth/joined_recordings.h"
#include "tests/truth/recordings_world.h"

namespace kinescope {
namespace {

using truth::RecordingOptions;
using truth::World;

constexpr double kZero = 0.004;  // rad, of the second joint in the second recording

truth::FilmedRobotOptions arm(std::uint64_t seed) {
  truth::FilmedRobotOptions out;
  out.seed = seed;
  out.duration_s = 6.0;
  out.tag_size_m = 0.08;
  out.scale = 1.5;
  out.distance_m = 1.6;
  return out;
}

// Of the same robot; the second with three times the noise.
std::vector<World> two_recordings(std::uint64_t seed, double zero = 0.0) {
  std::vector<RecordingOptions> out(2);
  out[0].name = "first";
  out[0].motion = 2 * seed;
  out[0].camera.rate_hz = 10.0;
  out[1].name = "second";
  out[1].motion = 2 * seed + 1;
  out[1].camera.azimuth_rad = 0.6;
  out[1].camera.rate_hz = 12.0;
  out[1].camera.sigma_px = 0.3;
  if (zero != 0.0) out[1].zeros[1] = zero;
  return truth::make_recordings(arm(seed), out);
}

// Adds to a joint in one recording.
Correction zero_in(const truth::JoinedRecordings& joined, int joint, int recording) {
  Correction out;
  out.name = "zero";
  out.block = "q2";
  out.unit = "rad";
  out.index = joint;
  out.direction = Vector6d::Unit(2);  // about z
  const std::vector<int>& of = joined.measurements.camera_of_frame;
  out.share.resize(static_cast<Eigen::Index>(of.size()));
  for (std::size_t f = 0; f < of.size(); ++f)
    out.share[static_cast<Eigen::Index>(f)] = of[f] == recording ? 1.0 : 0.0;
  return out;
}

Calibration calibrated_together(const std::vector<World>& worlds, std::uint64_t seed,
                                bool with_zero = false) {
  const truth::JoinedRecordings joined = truth::joined_recordings(worlds);
  CalibrationStart start = truth::perturbed_starts(worlds, seed);
  if (with_zero) start.corrections.push_back(zero_in(joined, 1, 1));
  CalibrateOptions options;
  options.folds = 0;
  return calibrate(joined.measurements, worlds.front().markers, joined.log, start, options);
}

Calibration calibrated_alone(const World& world, std::uint64_t seed) {
  CalibrateOptions options;
  options.folds = 0;
  return calibrate(world.measurements, world.markers, world.log,
                   truth::perturbed_start(world, 0.003, 0.003, seed), options);
}

double among_sigma(const Calibration& of) {
  double sum = 0.0;
  for (const JointEstimate& joint : of.joints)
    sum += std::pow(value_of(joint.among_direction_sigma_rad), 2);
  return std::sqrt(sum);
}

// Each by its own noise: what both say is what each says, weighted by it.
TEST(SeveralRecordings, KnowWhatTheyKnowTogether) {
  const std::vector<World> worlds = two_recordings(11);
  const Calibration together = calibrated_together(worlds, 11);
  ASSERT_EQ(together.status, CalibrationStatus::kConverged);
  const double first = among_sigma(calibrated_alone(worlds[0], 11));
  const double second = among_sigma(calibrated_alone(worlds[1], 11));
  const double expected = 1.0 / std::hypot(1.0 / first, 1.0 / second);
  EXPECT_LT(among_sigma(together), std::min(first, second));
  // Uncertainties of single recordings are themselves known to a quarter or so; clocks and mounts
  // that are shared say a little more.
  EXPECT_NEAR(among_sigma(together), expected, 0.35 * expected);
  const std::vector<CameraErrors> errors = errors_of_cameras(together);
  EXPECT_NEAR(errors[0].final_rms, 0.1 * std::sqrt(2.0), 0.02);
  EXPECT_NEAR(errors[1].final_rms, 0.3 * std::sqrt(2.0), 0.06);
}

// Axes among one another, and the zero that differs, over many robots: their errors are what the
// covariance claims.
TEST(SeveralRecordings, ScatterAsTheyClaim) {
  constexpr int kRobots = 60;
  int held = 0, count = 0;
  double squares = 0.0;
  for (int k = 0; k < kRobots; ++k) {
    const auto seed = static_cast<std::uint64_t>(300 + k);
    const std::vector<World> worlds = two_recordings(seed, kZero);
    const Calibration found = calibrated_together(worlds, seed, true);
    if (found.status != CalibrationStatus::kConverged) continue;
    const truth::AxisDifferences errors = truth::axis_differences(worlds.front().tree, found);
    for (std::size_t j = 0; j < found.joints.size(); ++j) {
      held +=
          errors.among[j].direction_rad < 2.0 * value_of(found.joints[j].among_direction_sigma_rad)
              ? 1
              : 0;
      ++count;
    }
    const auto zero = std::ranges::find(found.parameters, "effects", &Parameter::block);
    ASSERT_NE(zero, found.parameters.end());
    squares += std::pow((zero->value - kZero) / value_of(zero->sigma), 2);
  }
  ASSERT_GT(count, 2 * kRobots);
  // 95 of 100, four standard deviations of a share of 180: 0.065. Claims may be too large.
  EXPECT_GT(held, (0.95 - 0.065) * count);
  // Chi-square over 60 zeros: mean 1, standard deviation 0.18; claims are widened for noise that
  // lasts.
  const double zeros = count / 3.0;
  EXPECT_GT(squares / zeros, 0.4);
  EXPECT_LT(squares / zeros, 1.7);
}

// Poses as a camera shows them, exactly.
PoseTracks exact_tracks(const World& world) {
  PoseTracks out;
  out.times_s = world.measurements.times_s;
  for (const Marker& marker : world.tree.markers) {
    PoseTrack track{marker.id, {}};
    for (int f = 0; f < static_cast<int>(out.times_s.size()); ++f) {
      PoseSample& sample = track.samples.emplace_back();
      sample.frame = f;
      sample.T_camera_marker =
          world.T_camera_base *
          forward_kinematics(world.tree, world.joint_values.row(f))[marker.link.index()] *
          marker.T_link_marker;
    }
    out.tracks.push_back(std::move(track));
  }
  return out;
}

void expect_same_pose(const Pose& a, const Pose& b, double tolerance) {
  EXPECT_LT(log_pose(a.inverse() * b).norm(), tolerance);
}

// One marker sits elsewhere, and one is there that the robot has not: the others say where the base
// is.
TEST(PlaceRecording, IsByTheMarkersThatSitWhereTheySat) {
  constexpr double kRounding = 1e-6;  // rad, m
  const std::vector<World> worlds = two_recordings(5);
  World second = worlds[1];
  Pose elsewhere;
  elsewhere.rotation = exp_rotation({0.0, 0.1, 0.8});
  elsewhere.translation = {0.02, 0.01, 0.0};
  Marker& moved = second.tree.markers[2];
  moved.T_link_marker = moved.T_link_marker * elsewhere;
  KinematicTree robot = worlds[0].tree;
  const Marker unknown = robot.markers.back();
  robot.markers.pop_back();
  const RecordingPlacement placed =
      place_recording(robot, second.joint_values, exact_tracks(second));
  expect_same_pose(placed.T_camera_base, second.T_camera_base, kRounding);
  ASSERT_EQ(placed.markers.size(), second.tree.markers.size());
  for (std::size_t m = 0; m < placed.markers.size(); ++m) {
    EXPECT_EQ(placed.markers[m].marker.link, second.tree.markers[m].link);
    expect_same_pose(placed.markers[m].marker.T_link_marker, second.tree.markers[m].T_link_marker,
                     kRounding);
    EXPECT_EQ(placed.markers[m].is_known, second.tree.markers[m].id != unknown.id);
  }
}

// All of them sit elsewhere: the joints' motion says where the base is.
TEST(PlaceRecording, NeedsNoMarkerThatStayed) {
  constexpr double kRounding = 1e-4;  // rad, m
  const std::vector<World> worlds = two_recordings(6);
  World second = worlds[1];
  for (Marker& marker : second.tree.markers) {
    Pose elsewhere;
    elsewhere.rotation = exp_rotation({0.3, 0.1, 0.5 * marker.id.value});
    elsewhere.translation = {0.03, 0.001 * marker.id.value, 0.0};
    marker.T_link_marker = marker.T_link_marker * elsewhere;
  }
  const RecordingPlacement placed =
      place_recording(worlds[0].tree, second.joint_values, exact_tracks(second));
  expect_same_pose(placed.T_camera_base, second.T_camera_base, kRounding);
}

TEST(PlaceRecording, RefusesWhatShowsNothing) {
  const std::vector<World> worlds = two_recordings(7);
  KinematicTree robot = worlds[0].tree;
  robot.markers.clear();
  PoseTracks tracks = exact_tracks(worlds[1]);
  tracks.tracks.resize(1);  // the one at rest
  EXPECT_THROW(static_cast<void>(place_recording(robot, worlds[1].joint_values, tracks)), Error);
}

}  // namespace
}  // namespace kinescope
