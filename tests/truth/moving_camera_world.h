// SPDX-License-Identifier: Apache-2.0
//
// Takes   a robot of filmed_robot.h.
// Gives   a World whose camera moves: on the robot's last link, before a wall of tags, or in a
//         person's hand, before the robot with further tags about its base. Exact truth, noise on
//         the corners, a joint log with its own clock.
// Frames  World::tree's base; the wall and the tags about the base are on link 0.
#pragma once

#include <vector>

#include "tests/truth/camera_world.h"
#include "tests/truth/filmed_robot.h"

namespace kinescope::truth {

enum class CameraCarrier { kRobot, kPerson };

struct MovingCameraOptions {
  FilmedRobotOptions robot;
  CameraCarrier carrier = CameraCarrier::kRobot;
  double rate_hz = 30.0;
  double log_rate_hz = 200.0;
  double clock_s = 0.0;  ///< joint-log time = frame time + this
  double sigma_px = 0.1;
  int wall_tags = 4;          ///< a side of the wall, of a camera on the robot
  double wall_step_m = 0.32;  ///< from tag to tag
  double wall_distance_m = 0.9;
  /// Tags of the links stay, of a camera on the robot, as far as it sees them.
  bool link_tags = false;
  int base_tags = 4;     ///< about the base, of a camera in a hand
  double sway_m = 0.15;  ///< of a hand, each way
  double sway_rad = 0.12;
};

struct MovingCameraWorld {
  World world;  ///< T_camera_base: in the first frame
  LinkId camera_link{0};
  Pose T_link_camera;      ///< of a camera on the robot
  std::vector<Pose> path;  ///< T_camera_base, one a frame
};

[[nodiscard]] MovingCameraWorld make_moving_camera_world(const MovingCameraOptions& options);

}  // namespace kinescope::truth
