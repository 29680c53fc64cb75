// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/camera_world.h"

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "kinematics/core/rng.h"

namespace kinescope::truth {
namespace {

constexpr double kPrismaticScale = 0.12;  // m per rad of the trajectory

// Three sines a joint, of frequencies that no two joints share.
struct Motion {
  std::vector<std::array<double, 9>> terms;  // amplitude, frequency, phase, three times
  double value(std::size_t joint, double t) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& a = terms[joint];
      sum += a[3 * k] * std::sin(2.0 * std::numbers::pi * a[3 * k + 1] * t + a[3 * k + 2]);
    }
    return sum;
  }
};

Motion random_motion(const WorldOptions& options, Rng& rng) {
  Motion motion;
  for (const JointType type : options.joints) {
    std::array<double, 9> a{};
    const double unit = type == JointType::kPrismatic ? kPrismaticScale : 1.0;
    for (std::size_t k = 0; k < 3; ++k) {
      a[3 * k] = unit * options.amplitude_rad / 3.0 * rng.uniform(0.7, 1.0);
      a[3 * k + 1] = rng.uniform(0.1, 0.5);
      a[3 * k + 2] = rng.uniform(0.0, 2.0 * std::numbers::pi);
    }
    motion.terms.push_back(a);
  }
  return motion;
}

Pose random_pose(Rng& rng, double rotation_rad, double translation_m) {
  Pose pose;
  pose.rotation = exp_rotation(rng.unit3() * rotation_rad);
  pose.translation = rng.unit3() * translation_m;
  return pose;
}

KinematicTree random_chain(const WorldOptions& options, Rng& rng) {
  KinematicTree tree;
  tree.links.push_back({"base"});
  for (std::size_t j = 0; j < options.joints.size(); ++j) {
    Joint joint;
    joint.name = fmt::format("q{}", j + 1);
    joint.channel = joint.name;
    joint.type = options.joints[j];
    joint.parent = LinkId{static_cast<int>(j)};
    joint.child = LinkId{static_cast<int>(j) + 1};
    joint.T_parent_joint = random_pose(rng, rng.uniform(0.0, 3.0), options.link_length_m);
    tree.joints.push_back(joint);
    tree.links.push_back({fmt::format("link{}", j + 1)});
  }
  return tree;
}

// Tags face the camera at the middle of the motion, tilted, so that they are seen most of the time.
void mount_tags(const WorldOptions& options, Rng& rng, World& world) {
  const std::vector<Pose> T_base_link = forward_kinematics(
      world.tree, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(world.tree.joints.size())));
  for (std::size_t l = options.base_tag ? 0 : 1; l < world.tree.links.size(); ++l) {
    const Pose T_camera_link = world.T_camera_base * T_base_link[l];
    Pose T_camera_tag;
    Eigen::Vector3d tilt = rng.unit3() * rng.uniform(0.3, 0.7);
    tilt.z() = rng.uniform(-3.0, 3.0);
    T_camera_tag.rotation =
        exp_rotation({tilt.x(), tilt.y(), 0.0}) * exp_rotation({0, 0, tilt.z()});
    T_camera_tag.translation = T_camera_link.translation + rng.unit3() * 0.03;
    Marker marker;
    marker.id = TagId{static_cast<int>(l) + 10};
    marker.link = LinkId{static_cast<int>(l)};
    marker.T_link_marker = T_camera_link.inverse() * T_camera_tag;
    marker.size_m = options.tag_size_m;
    world.tree.markers.push_back(marker);
  }
}

void log_joints(const WorldOptions& options, const Motion& motion, World& world) {
  const double margin_s = 0.5;
  const double duration = options.frames / options.frame_rate_hz;
  const auto joints = static_cast<Eigen::Index>(options.joints.size());
  const int samples = static_cast<int>((duration + 2.0 * margin_s) * options.log_rate_hz);
  world.log.values.resize(samples, joints);
  for (const Joint& joint : world.tree.joints) world.log.channels.push_back(joint.name);
  for (int i = 0; i < samples; ++i) {
    const double t = i / options.log_rate_hz - margin_s;
    world.log.times_s.push_back(t);
    for (Eigen::Index j = 0; j < joints; ++j) {
      world.log.values(i, j) = motion.value(static_cast<std::size_t>(j), t);
    }
  }
}

void film(const WorldOptions& options, const Motion& motion, Rng& rng, World& world) {
  const auto joints = static_cast<Eigen::Index>(options.joints.size());
  world.joint_values.resize(options.frames, joints);
  for (int f = 0; f < options.frames; ++f) {
    const double t = f / options.frame_rate_hz;
    world.measurements.times_s.push_back(t);
    for (Eigen::Index j = 0; j < joints; ++j) {
      world.joint_values(f, j) =
          motion.value(static_cast<std::size_t>(j), t + options.time_offset_s);
    }
    const auto T_base_link = forward_kinematics(world.tree, world.joint_values.row(f));
    for (const Marker& marker : world.tree.markers) {
      const Pose T_camera_tag =
          world.T_camera_base * T_base_link[marker.link.index()] * marker.T_link_marker;
      // From behind, or nearly edge on, a tag is not found.
      if (T_camera_tag.matrix3().col(2).dot(T_camera_tag.translation.normalized()) < 0.25) continue;
      TagObservation seen;
      seen.frame = f;
      seen.id = marker.id;
      seen.sigma_px = options.sigma_px > 0.0 ? options.sigma_px : 0.1;
      bool inside = true;
      for (const Eigen::Vector3d& corner : world.markers.corners_m(marker.id)) {
        const auto pixel = project(world.camera, T_camera_tag * corner);
        inside = inside && pixel && pixel->x() > 0 && pixel->y() > 0 &&
                 pixel->x() < world.camera.width && pixel->y() < world.camera.height;
        if (!inside) break;
        const double nx = rng.normal(options.sigma_px);
        const double ny = rng.normal(options.sigma_px);
        seen.corners_px.emplace_back(*pixel + Eigen::Vector2d(nx, ny));
      }
      if (!inside) continue;
      if (options.outliers > 0.0 && rng.uniform() < options.outliers) {
        seen.corners_px[static_cast<std::size_t>(rng.index(4))] += Eigen::Vector2d(8.0, -6.0);
        world.outliers.push_back(world.measurements.corners.size());
      }
      world.measurements.corners.push_back(seen);
    }
  }
}

}  // namespace

World make_world(const WorldOptions& asked) {
  WorldOptions options = asked;
  if (options.robot) {
    options.joints.clear();
    for (const Joint& joint : options.robot->joints) options.joints.push_back(joint.type);
  }
  Rng rng = Rng::from_name("camera world", options.seed);
  World world;
  world.camera = pinhole_guess(1280, 720, 900.0);
  world.camera.distortion = {-0.08, 0.03, 0.0005, -0.0004, 0.0};
  world.markers.default_size_m = options.tag_size_m;
  world.tree = options.robot ? *options.robot : random_chain(options, rng);
  world.tree.markers.clear();
  world.T_camera_base = random_pose(rng, rng.uniform(0.0, 3.0), 0.0);
  world.T_camera_base.translation << 0.0, 0.0, options.distance_m;
  mount_tags(options, rng, world);
  const Motion motion = random_motion(options, rng);
  log_joints(options, motion, world);
  film(options, motion, rng, world);
  return world;
}

CalibrationStart perturbed_start(const World& world, double sigma_rad, double sigma_m,
                                 std::uint64_t seed) {
  Rng rng = Rng::from_name("perturbed start", seed);
  const auto perturb = [&](Pose& pose) {
    Vector6d d;
    d << rng.normal3(sigma_rad), rng.normal3(sigma_m);
    pose = pose * exp_pose(d);
  };
  CalibrationStart start;
  start.tree = world.tree;
  start.T_camera_base = world.T_camera_base;
  start.camera = world.camera;
  perturb(start.T_camera_base);
  for (Joint& joint : start.tree.joints) perturb(joint.T_parent_joint);
  for (Marker& marker : start.tree.markers) {
    if (marker.link != LinkId{0}) perturb(marker.T_link_marker);
  }
  return start;
}

}  // namespace kinescope::truth
