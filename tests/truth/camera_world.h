// SPDX-License-Identifier: Apache-2.0
//
// A robot with tags before a camera, at corner level: exact truth, noise on the corners, a joint
// log with its own clock. Scene, noise and motion are options; the same seed gives the same world.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "calib/bundle/calibrate.h"

namespace kinescope::truth {

struct WorldOptions {
  std::uint64_t seed = 1;
  std::vector<JointType> joints{JointType::kRevolute, JointType::kRevolute, JointType::kRevolute};
  int frames = 150;
  double frame_rate_hz = 30.0;
  double log_rate_hz = 200.0;
  double sigma_px = 0.1;  ///< noise of the corners; 0: exact
  double tag_size_m = 0.05;
  double distance_m = 1.3;  ///< of the camera
  double link_length_m = 0.12;
  double amplitude_rad = 1.0;  ///< largest joint value; prismatic joints: 0.12 m per rad
  double time_offset_s = 0.0;  ///< joint-log time = frame time + offset
  bool base_tag = true;
  double outliers = 0.0;  ///< share of sightings with one corner thrown far off
  /// Filmed in place of a random chain of `joints`: a robot whose joints are these, with their
  /// channels; camera, markers and motion are the seed's.
  std::optional<KinematicTree> robot = {};
};

struct World {
  KinematicTree tree;  ///< the truth, axes z
  Pose T_camera_base;
  CameraModel camera;
  MarkerSet markers;
  JointLog log;  ///< one channel a joint, named as the joint
  Measurements measurements;
  Eigen::MatrixXd joint_values;       ///< frames x joints, what the frames show
  std::vector<std::size_t> outliers;  ///< indices into measurements.corners
};

[[nodiscard]] World make_world(const WorldOptions& options);

/// The truth moved by about the given amounts: what a structure search hands to the bundle.
[[nodiscard]] CalibrationStart perturbed_start(const World& world, double sigma_rad, double sigma_m,
                                               std::uint64_t seed);

}  // namespace kinescope::truth
