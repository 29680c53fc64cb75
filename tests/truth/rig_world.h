// SPDX-License-Identifier: Apache-2.0
//
// Takes   a robot of filmed_robot.h and several cameras around it.
// Gives   a World for each camera, of one robot, motion and joint log: exact truth, noise on the
//         corners, frames on the camera's own clock.
// Frames  a camera at azimuth a sees what camera 0 sees of the robot turned by a about the vertical
//         through its middle.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tests/truth/camera_world.h"
#include "tests/truth/filmed_robot.h"

namespace kinescope::truth {

struct RigCamera {
  std::string name;
  double azimuth_rad = 0.0;
  double clock_s = 0.0;  ///< joint-log time = frame time + this
  double rate_hz = 30.0;
  double sigma_px = 0.1;
  /// From this time on (own clock) it stands turned by as much about its own x.
  double bumped_s = 1e9;
  double bump_rad = 0.0;
  /// From when on its focal length is another one, by its own clock, and by what share.
  double refocused_s = 1e9;
  double refocus = 0.0;
};

struct RigOptions {
  FilmedRobotOptions robot;
  std::vector<RigCamera> cameras;
  /// Tag id: camera that it faces in the middle posture, in place of camera 0.
  std::map<int, std::size_t> faces = {};
  double log_rate_hz = 200.0;
};

/// What the encoders say, from half a second before the motion to as long after it.
[[nodiscard]] JointLog rig_log(const FilmedRobot& robot, double rate_hz);
/// What one camera sees of the robot; the log is given to the world as it is.
[[nodiscard]] World rig_view(const FilmedRobot& robot, const JointLog& log,
                             const RigCamera& camera);

/// One for each camera; World::joint_values are those of its frames.
[[nodiscard]] std::vector<World> make_rig_worlds(const RigOptions& options);

/// The worlds as one recording: corners_NAME.csv and camera_NAME.yaml of each camera, joints.csv,
/// tags.yaml in a folder, which is made.
void write_rig(const std::vector<World>& worlds, const RigOptions& options,
               const std::filesystem::path& folder);

}  // namespace kinescope::truth
