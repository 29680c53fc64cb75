// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/moving_camera_world.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "tests/truth/rig_world.h"
#include "tests/truth/seen_tag.h"

namespace kinescope::truth {
namespace {

constexpr int kFirstWallId = 100;
constexpr int kFirstBaseId = 50;

std::vector<Pose> middle_links(const KinematicTree& tree) {
  return forward_kinematics(tree,
                            Eigen::VectorXd::Zero(static_cast<Eigen::Index>(tree.joints.size())));
}

Marker on_base(int id, const Pose& T_base_marker, double size_m) {
  return {TagId{id}, LinkId{0}, T_base_marker, size_m};
}

// Square to the camera in the middle posture, each tag leant a little its own way.
void build_wall(const MovingCameraOptions& options, const Pose& T_base_camera, Rng& rng,
                KinematicTree& tree) {
  const double middle = 0.5 * (options.wall_tags - 1);
  for (int row = 0; row < options.wall_tags; ++row) {
    for (int column = 0; column < options.wall_tags; ++column) {
      Pose T_camera_tag;
      T_camera_tag.rotation = exp_rotation(rng.normal3(0.15));
      T_camera_tag.translation = {options.wall_step_m * (column - middle),
                                  options.wall_step_m * (row - middle),
                                  options.wall_distance_m + rng.uniform(-0.1, 0.1)};
      tree.markers.push_back(on_base(kFirstWallId + row * options.wall_tags + column,
                                     T_base_camera * T_camera_tag, options.robot.tag_size_m));
    }
  }
}

void put_camera_on_tip(const MovingCameraOptions& options, Rng& rng, MovingCameraWorld& out) {
  KinematicTree& tree = out.world.tree;
  if (!options.link_tags) tree.markers.clear();
  std::erase_if(tree.markers, [&](const Marker& m) { return m.link.value == 0; });
  out.camera_link = LinkId{static_cast<int>(tree.links.size()) - 1};
  out.T_link_camera.rotation = exp_rotation(rng.normal3(0.8));
  out.T_link_camera.translation = rng.normal3(0.03);
  build_wall(options, middle_links(tree)[out.camera_link.index()] * out.T_link_camera, rng, tree);
}

// As the first base tag is turned, within a hand's width of one another.
void add_base_tags(const MovingCameraOptions& options, Rng& rng, KinematicTree& tree) {
  const Pose first = tree.markers.front().T_link_marker;
  for (int k = 0; k < options.base_tags; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / options.base_tags;
    Pose beside;
    beside.rotation = exp_rotation(rng.normal3(0.2));
    beside.translation = {0.14 * std::cos(angle), 0.14 * std::sin(angle), rng.normal(0.02)};
    tree.markers.push_back(on_base(kFirstBaseId + k, first * beside, options.robot.tag_size_m));
  }
}

// Six of them make a hand.
std::vector<SmoothMotion> sway_of(const MovingCameraOptions& options, Rng& rng) {
  FilmedRobotOptions slow = options.robot;
  slow.lowest_hz = 0.1;
  slow.highest_hz = 0.7;
  std::vector<SmoothMotion> out;
  for (int i = 0; i < 6; ++i)
    out.emplace_back(i < 3 ? options.sway_rad : options.sway_m, slow, rng);
  return out;
}

Pose swayed(const std::vector<SmoothMotion>& sway, double t_s, const Pose& T_camera_base) {
  Vector6d twist;
  for (Eigen::Index i = 0; i < 6; ++i) twist[i] = sway[static_cast<std::size_t>(i)].value(t_s);
  return exp_pose(twist) * T_camera_base;
}

void film(const MovingCameraOptions& options, const FilmedRobot& robot, Rng& rng,
          MovingCameraWorld& out) {
  World& world = out.world;
  const std::vector<SmoothMotion> sway = sway_of(options, rng);
  const auto frames = static_cast<int>(robot.duration_s * options.rate_hz);
  world.joint_values.resize(frames, static_cast<Eigen::Index>(world.tree.joints.size()));
  for (int f = 0; f < frames; ++f) {
    const double log_s = f / options.rate_hz;
    const Eigen::VectorXd q = robot.encoders(log_s);
    const std::vector<Pose> links = forward_kinematics(world.tree, q);
    world.joint_values.row(f) = q.transpose();
    world.measurements.times_s.push_back(log_s - options.clock_s);
    out.path.push_back(options.carrier == CameraCarrier::kPerson
                           ? swayed(sway, log_s, robot.T_camera_base)
                           : (links[out.camera_link.index()] * out.T_link_camera).inverse());
    for (const Marker& marker : world.tree.markers) {
      auto tag = seen_tag(world, marker,
                          out.path.back() * links[marker.link.index()] * marker.T_link_marker,
                          options.sigma_px, rng);
      if (!tag) continue;
      tag->frame = f;
      world.measurements.corners.push_back(std::move(*tag));
    }
  }
  world.T_camera_base = out.path.front();
}

}  // namespace

MovingCameraWorld make_moving_camera_world(const MovingCameraOptions& options) {
  const FilmedRobot robot = draw_filmed_robot(options.robot);
  Rng rng = Rng::from_name("moving camera", options.robot.seed);
  MovingCameraWorld out;
  out.world.tree = robot.tree;
  out.world.camera = robot.camera;
  out.world.markers = robot.markers;
  out.world.log = rig_log(robot, options.log_rate_hz);
  if (options.carrier == CameraCarrier::kRobot) {
    put_camera_on_tip(options, rng, out);
  } else {
    add_base_tags(options, rng, out.world.tree);
  }
  std::ranges::stable_sort(out.world.tree.markers, {}, &Marker::id);
  film(options, robot, rng, out);
  return out;
}

}  // namespace kinescope::truth
