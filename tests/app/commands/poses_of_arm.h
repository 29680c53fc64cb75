// SPDX-License-Identifier: Apache-2.0
//
// A recording of a random arm as poses.csv and joints.csv.
#pragma once

#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/io/products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/random_robot.h"

namespace kinescope {

inline std::string joints_csv(const JointLog& log) {
  std::string text = "t";
  for (const std::string& channel : log.channels) text += "," + channel;
  text += "\n";
  for (Eigen::Index i = 0; i < log.values.rows(); ++i) {
    text += fmt::format("{}", log.times_s[static_cast<std::size_t>(i)]);
    for (Eigen::Index c = 0; c < log.values.cols(); ++c) {
      text += fmt::format(",{}", log.values(i, c));
    }
    text += "\n";
  }
  return text;
}

struct PosesOfArm {
  RobotRecording recording;
  std::vector<std::string> channel;  // of each joint
};

inline PosesOfArm arm(const std::string& name, const RecordingOptions& options, int joints = 3) {
  Rng rng = Rng::from_name(name);
  const RandomRobot robot = random_robot({.joints = joints, .prismatic_share = 0.0}, rng);
  PosesOfArm out{record(robot, options, rng), {}};
  for (const int c : out.recording.channel_of_joint) {
    out.channel.push_back(out.recording.log.channels[static_cast<std::size_t>(c)]);
  }
  return out;
}

inline void write_poses(const RobotRecording& recording, const RecordingFolder& folder) {
  folder.write("poses.csv", tracks_csv(recording.tracks));
  folder.write("joints.csv", joints_csv(recording.log));
}

}  // namespace kinescope
