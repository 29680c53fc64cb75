// SPDX-License-Identifier: Apache-2.0
//
// Takes   a robot of filmed_robot.h and several recordings of it.
// Gives   a World for each: the same robot in another motion, before a camera that stands
// elsewhere,
//         with clock and noise of its own; what differs of the robot or its markers is an option.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tests/truth/rig_world.h"

namespace kinescope::truth {

struct RecordingOptions {
  std::string name;
  std::uint64_t motion = 1;             ///< seed of it
  RigCamera camera;                     ///< its name is not used
  double reach = 1.0;                   ///< of every joint, beside the robot's own
  std::map<std::size_t, double> still;  ///< joint: reach in its place (0: it stands still)
  /// Joint: rad or m that the joint is further than its reading says, beside the other recordings.
  std::map<std::size_t, double> zeros;
  std::map<int, Pose> moved;  ///< tag id: from where it sits to where it sits in this recording
  double growth = 0.0;        ///< of all lengths of the robot
};

/// Worlds beside the recordings; the truth of each is its own robot.
[[nodiscard]] std::vector<World> make_recordings(const FilmedRobotOptions& robot,
                                                 const std::vector<RecordingOptions>& recordings);

/// Each in a folder of its name below `root`, as corners.csv. Gives the folders.
std::vector<std::filesystem::path> write_recordings(const std::vector<World>& worlds,
                                                    const std::vector<RecordingOptions>& recordings,
                                                    const std::filesystem::path& root);

}  // namespace kinescope::truth
