// SPDX-License-Identifier: Apache-2.0
//
// A camera and a robot's hand with exact truth: poses of a flange as a controller logs them, and
// markers seen as corners or poses. The same seed gives the same world.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/hand_eye/hand_eye.h"

namespace kinescope::truth {

struct HandEyeWorldOptions {
  std::uint64_t seed = 1;
  CameraMount mount = CameraMount::kOnHand;
  PoseDirection direction = PoseDirection::kBaseFlange;
  int poses = 20;
  int targets = 1;
  bool corners = true;         ///< else poses
  double sigma_px = 0.2;       ///< of the corners; 0: exact
  double target_size_m = 0.1;  ///< edge
  double pose_sigma_m = 1e-3;  ///< of seen poses
  double pose_sigma_rad = 3e-3;
  double flange_sigma_m = 3e-4;  ///< of the controller's positions, one axis
  double flange_sigma_rad = 5e-4;
  double turn_rad = 0.5;  ///< of the hand about each axis, either way
  bool one_axis = false;  ///< it turns about one axis of its own alone
  double scale = 0.0;     ///< the controller's positions are shorter by this share
  double bump_m = 0.0;    ///< the camera is shifted by it from half of the poses on
  int wrong_row = -1;     ///< whose position is off by 20 mm
  bool motion = false;    ///< 30 frames and 100 rows a second; else postures
  double lag_s = 0.0;     ///< log time minus frame time, of a motion
  double drift = 0.0;  ///< and a second of frame time that is more, from the middle of the frames
};

struct HandEyeWorld {
  HandEyeInput input;
  Pose camera;                ///< T_flange_camera or T_base_camera
  std::vector<Pose> targets;  ///< T_base_target or T_flange_target
};

[[nodiscard]] HandEyeWorld make_hand_eye_world(const HandEyeWorldOptions& options);

}  // namespace kinescope::truth
