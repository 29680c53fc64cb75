// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/recordings_world.h"

#include "kinematics/core/rng.h"
#include "tests/truth/recorded_world.h"

namespace kinescope::truth {
namespace {

constexpr double kLogRateHz = 200.0;

// Another motion of the same robot.
void move_otherwise(const FilmedRobotOptions& options, const RecordingOptions& recording,
                    FilmedRobot& robot) {
  Rng rng = Rng::from_name("recording", recording.motion);
  robot.motions.clear();
  for (std::size_t j = 0; j < robot.tree.joints.size(); ++j) {
    const bool slides = robot.tree.joints[j].type == JointType::kPrismatic;
    const double unit = slides ? options.prismatic_m_per_rad * options.scale : 1.0;
    const auto own = recording.still.find(j);
    const double reach = own == recording.still.end() ? recording.reach : own->second;
    robot.motions.emplace_back(options.amplitude_rad * reach * unit, options, rng);
  }
}

void grow(double growth, KinematicTree& tree) {
  for (Joint& joint : tree.joints) joint.T_parent_joint.translation *= 1.0 + growth;
  for (Marker& marker : tree.markers)
    if (marker.link != LinkId{0}) marker.T_link_marker.translation *= 1.0 + growth;
}

}  // namespace

std::vector<World> make_recordings(const FilmedRobotOptions& options,
                                   const std::vector<RecordingOptions>& recordings) {
  std::vector<World> out;
  for (const RecordingOptions& recording : recordings) {
    FilmedRobot robot = draw_filmed_robot(options);
    move_otherwise(options, recording, robot);
    grow(recording.growth, robot.tree);
    for (Marker& marker : robot.tree.markers)
      if (const auto moved = recording.moved.find(marker.id.value); moved != recording.moved.end())
        marker.T_link_marker = marker.T_link_marker * moved->second;
    RigCamera camera = recording.camera;
    camera.name = recording.name;
    JointLog log = rig_log(robot, kLogRateHz);
    for (const auto& [joint, zero] : recording.zeros)
      log.values.col(static_cast<Eigen::Index>(joint)).array() -= zero;
    out.push_back(rig_view(robot, log, camera));
  }
  return out;
}

std::vector<std::filesystem::path> write_recordings(const std::vector<World>& worlds,
                                                    const std::vector<RecordingOptions>& recordings,
                                                    const std::filesystem::path& root) {
  std::vector<std::filesystem::path> out;
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    out.push_back(root / recordings[k].name);
    write_world(worlds[k], out.back());
  }
  return out;
}

}  // namespace kinescope::truth
