// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/rig_world.h"

#include <fmt/format.h>

#include "calib/camera/camera_file.h"
#include "kinematics/core/file.h"
#include "tests/truth/recorded_world.h"
#include "tests/truth/seen_tag.h"

namespace kinescope::truth {
namespace {

constexpr double kLogBeyond = 0.5;  // s, that the log begins before and ends after the motion

// The robot turned about the vertical through its middle, base frame.
Pose turned_about_middle(const FilmedRobot& robot, double angle_rad) {
  const std::vector<Pose> links = forward_kinematics(
      robot.tree, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(robot.tree.joints.size())));
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Pose& link : links) middle += link.translation / static_cast<double>(links.size());
  Pose T;
  T.rotation = exp_rotation({0.0, 0.0, angle_rad});
  T.translation = middle - T.rotation * middle;
  return T;
}

// Tags that face another camera than the first.
void turn_tags(const RigOptions& options, FilmedRobot& robot) {
  const std::vector<Pose> links = forward_kinematics(
      robot.tree, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(robot.tree.joints.size())));
  for (Marker& marker : robot.tree.markers) {
    const auto faces = options.faces.find(marker.id.value);
    if (faces == options.faces.end()) continue;
    Pose T_base_marker = links[marker.link.index()] * marker.T_link_marker;
    T_base_marker.rotation = exp_rotation({0.0, 0.0, -options.cameras[faces->second].azimuth_rad}) *
                             T_base_marker.rotation;
    marker.T_link_marker = links[marker.link.index()].inverse() * T_base_marker;
  }
}

}  // namespace

JointLog rig_log(const FilmedRobot& robot, double rate_hz) {
  JointLog log;
  log.source = "joints.csv";
  for (const Joint& joint : robot.tree.joints) log.channels.push_back(joint.channel);
  for (double t = -kLogBeyond; t <= robot.duration_s + kLogBeyond; t += 1.0 / rate_hz)
    log.times_s.push_back(t);
  log.values.resize(static_cast<Eigen::Index>(log.times_s.size()),
                    static_cast<Eigen::Index>(log.channels.size()));
  for (std::size_t i = 0; i < log.times_s.size(); ++i)
    log.values.row(static_cast<Eigen::Index>(i)) = robot.encoders(log.times_s[i]).transpose();
  return log;
}

World rig_view(const FilmedRobot& robot, const JointLog& log, const RigCamera& camera) {
  World world;
  world.tree = robot.tree;
  world.camera = robot.camera;
  world.markers = robot.markers;
  world.log = log;
  world.T_camera_base = robot.T_camera_base * turned_about_middle(robot, camera.azimuth_rad);
  Rng rng = Rng::from_name("rig " + camera.name, robot.seed);
  Pose T_bumped;
  T_bumped.rotation = exp_rotation({camera.bump_rad, 0.0, 0.0});
  World refocused = world;
  refocused.camera.fx *= 1.0 + camera.refocus;
  refocused.camera.fy *= 1.0 + camera.refocus;
  const auto frames = static_cast<int>(robot.duration_s * camera.rate_hz);
  world.joint_values.resize(frames, static_cast<Eigen::Index>(robot.tree.joints.size()));
  for (int f = 0; f < frames; ++f) {
    const double log_s = f / camera.rate_hz;
    const Eigen::VectorXd q = robot.encoders(log_s);
    world.joint_values.row(f) = q.transpose();
    world.measurements.times_s.push_back(log_s - camera.clock_s);
    const std::vector<Pose> links = forward_kinematics(robot.tree, q);
    const Pose T_camera_base = world.measurements.times_s.back() < camera.bumped_s
                                   ? world.T_camera_base
                                   : T_bumped * world.T_camera_base;
    const bool is_refocused = world.measurements.times_s.back() >= camera.refocused_s;
    for (const Marker& marker : robot.tree.markers) {
      auto tag = seen_tag(is_refocused ? refocused : world, marker,
                          T_camera_base * links[marker.link.index()] * marker.T_link_marker,
                          camera.sigma_px, rng);
      if (!tag) continue;
      tag->frame = f;
      world.measurements.corners.push_back(std::move(*tag));
    }
  }
  return world;
}

std::vector<World> make_rig_worlds(const RigOptions& options) {
  FilmedRobot robot = draw_filmed_robot(options.robot);
  turn_tags(options, robot);
  const JointLog log = rig_log(robot, options.log_rate_hz);
  std::vector<World> out;
  for (const RigCamera& camera : options.cameras) out.push_back(rig_view(robot, log, camera));
  return out;
}

void write_rig(const std::vector<World>& worlds, const RigOptions& options,
               const std::filesystem::path& folder) {
  for (std::size_t c = 0; c < worlds.size(); ++c) {
    const std::string& name = options.cameras[c].name;
    write_world(worlds[c], folder);
    std::filesystem::rename(folder / "corners.csv", folder / fmt::format("corners_{}.csv", name));
    std::filesystem::rename(folder / "camera.yaml", folder / fmt::format("camera_{}.yaml", name));
  }
}

}  // namespace kinescope::truth
