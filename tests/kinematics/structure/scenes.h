// SPDX-License-Identifier: Apache-2.0
//
// Shorthands shared by the structure tests.
#pragma once

#include <algorithm>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "kinematics/structure/structure.h"
#include "tests/truth/random_robot.h"

namespace kinescope {

inline constexpr double kDegree = std::numbers::pi / 180.0;

struct Scene {
  RandomRobot robot;
  RobotRecording recording;
};

inline Scene make_scene(const std::string& name, const RandomRobotOptions& robot_options,
                        const RecordingOptions& options) {
  Rng rng = Rng::from_name(name);
  Scene scene;
  scene.robot = random_robot(robot_options, rng);
  scene.recording = record(scene.robot, options, rng);
  return scene;
}

/// 3 mm and 0.5 deg a pose.
inline RecordingOptions noisy() {
  RecordingOptions o;
  o.sigma_m = 3e-3;
  o.sigma_rad = 0.5 * kDegree;
  return o;
}

/// The true link of every link found, by its markers (and link 0); -1 where it has none, -2 where
/// it mixes links.
inline std::vector<int> true_links(const Structure& s, const RandomRobot& robot) {
  std::vector<int> out(s.links.size(), -1);
  for (std::size_t l = 0; l < s.links.size(); ++l) {
    if (l == 0) out[l] = 0;
    for (const TagId tag : s.links[l].markers) {
      const int link = robot.tree.marker(tag)->link.value;
      out[l] = out[l] == -1 || out[l] == link ? link : -2;
    }
  }
  return out;
}

/// "parent-child type channel" of every joint, sorted; says what is wrong in one look.
inline std::vector<std::string> described(const Structure& s, const RandomRobot& robot) {
  const std::vector<int> links = true_links(s, robot);
  std::vector<std::string> out;
  for (const StructureJoint& j : s.joints) {
    out.push_back(std::to_string(links[static_cast<std::size_t>(j.parent_link)]) + "-" +
                  std::to_string(links[static_cast<std::size_t>(j.child_link)]) + " " +
                  std::string(to_string(j.type)) + " " +
                  std::to_string(j.channel ? j.channel->channel : -1));
  }
  std::ranges::sort(out);
  return out;
}

inline std::vector<std::string> described(const Scene& scene, bool with_channels = true) {
  std::vector<std::string> out;
  for (std::size_t j = 0; j < scene.robot.tree.joints.size(); ++j) {
    const Joint& joint = scene.robot.tree.joints[j];
    const int channel = with_channels ? scene.recording.channel_of_joint[j] : -1;
    out.push_back(std::to_string(joint.parent.value) + "-" + std::to_string(joint.child.value) +
                  " " + std::string(to_string(joint.type)) + " " + std::to_string(channel));
  }
  std::ranges::sort(out);
  return out;
}

/// The found joint that the channel of true joint k drives; nullptr when there is none.
inline const StructureJoint* joint_of(const Structure& s, const Scene& scene, std::size_t k) {
  for (const StructureJoint& j : s.joints) {
    if (j.channel && j.channel->channel == scene.recording.channel_of_joint[k]) return &j;
  }
  return nullptr;
}

}  // namespace kinescope
