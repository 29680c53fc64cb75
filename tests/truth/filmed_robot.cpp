// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/filmed_robot.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

namespace kinescope::truth {
namespace {

constexpr double kLink = 0.12;          // m, from joint to joint of a random chain
constexpr double kMisalignment = 0.01;  // rad and m / 2, of joints that are meant to be parallel

struct JointPlan {
  int parent = 0;
  JointType type = JointType::kRevolute;
  Pose T_parent_joint;
};

Pose random_offset(Rng& rng) {
  return {exp_rotation(rng.unit3() * rng.uniform(0.0, 3.0)), rng.unit3() * kLink};
}

std::vector<JointPlan> random_chain(int joints, Rng& rng) {
  std::vector<JointPlan> plan;
  plan.reserve(static_cast<std::size_t>(joints));
  for (int j = 0; j < joints; ++j) plan.push_back({j, JointType::kRevolute, random_offset(rng)});
  return plan;
}

// Trunk 0 - 1; branches 1 - 2 - 3 and 1 - 4 - 5, the second link of one of them on a slide.
std::vector<JointPlan> random_tree(Rng& rng) {
  const JointType third = rng.uniform() < 0.5 ? JointType::kPrismatic : JointType::kRevolute;
  const std::array<int, 5> parents{0, 1, 2, 1, 4};
  std::vector<JointPlan> plan;
  plan.reserve(parents.size());
  for (std::size_t j = 0; j < parents.size(); ++j) {
    plan.push_back({parents[j], j == 2 ? third : JointType::kRevolute, random_offset(rng)});
  }
  return plan;
}

// A designed offset as a workshop makes it: dimensions within 15 %, directions nearly true.
JointPlan built(int parent, JointType type, const Eigen::Vector3d& place, const Eigen::Vector3d& z,
                Rng& rng) {
  JointPlan plan{parent, type, {}};
  plan.T_parent_joint.translation =
      place * rng.uniform(0.85, 1.15) + rng.normal3(0.5 * kMisalignment);
  plan.T_parent_joint.rotation = exp_rotation(rng.normal3(kMisalignment)) * rotation_to_axis(z);
  return plan;
}

std::vector<JointPlan> scara(Rng& rng) {
  using enum JointType;
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  return {built(0, kRevolute, {0.0, 0.0, 0.15}, z, rng),
          built(1, kRevolute, {0.2, 0.0, 0.03}, z, rng),
          built(2, kPrismatic, {0.18, 0.0, -0.03}, z, rng),
          built(3, kRevolute, {0.0, 0.0, -0.1}, z, rng)};
}

// Frames of slides do not turn with each other: z of each joint is given in the base's axes.
std::vector<JointPlan> gantry(Rng& rng) {
  using enum JointType;
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  std::vector<JointPlan> plan{built(0, kPrismatic, {0.0, 0.1, 0.1}, x, rng),
                              built(1, kPrismatic, {0.05, 0.1, 0.05}, x, rng),
                              built(2, kPrismatic, {0.1, 0.05, 0.0}, x, rng),
                              built(3, kRevolute, {0.0, 0.05, 0.1}, x, rng)};
  // The rotation to x takes z to x and x to -z: three turns about y and z make x, y, z of the base.
  const Eigen::Quaterniond to_x = rotation_to_axis(x);
  const Eigen::Quaterniond to_y = rotation_to_axis(Eigen::Vector3d::UnitY());
  const std::array<Eigen::Quaterniond, 4> in_base{to_x, to_y, Eigen::Quaterniond::Identity(),
                                                  Eigen::Quaterniond::Identity()};
  Eigen::Quaterniond before = Eigen::Quaterniond::Identity();
  for (std::size_t j = 0; j < plan.size(); ++j) {
    Pose& T = plan[j].T_parent_joint;
    const Eigen::Quaterniond off = T.rotation * to_x.inverse();
    T.rotation = before.inverse() * off * in_base[j];
    before = in_base[j];
  }
  return plan;
}

std::vector<JointPlan> planar(Rng& rng) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  std::vector<JointPlan> plan;
  for (int j = 0; j < 4; ++j)
    plan.push_back(built(j, JointType::kRevolute, {0.12, 0.02 * (j % 2), 0.03}, z, rng));
  return plan;
}

std::vector<JointPlan> slider_wrist(Rng& rng) {
  std::vector<JointPlan> plan = random_chain(5, rng);
  plan[3].type = plan[4].type = JointType::kPrismatic;
  return plan;
}

std::vector<JointPlan> plan_of(RobotKind kind, Rng& rng) {
  switch (kind) {
    case RobotKind::kArm3:
      return random_chain(3, rng);
    case RobotKind::kArm6:
      return random_chain(6, rng);
    case RobotKind::kScara:
      return scara(rng);
    case RobotKind::kGantry:
      return gantry(rng);
    case RobotKind::kTree:
      return random_tree(rng);
    case RobotKind::kArm7:
      return random_chain(7, rng);
    case RobotKind::kPlanar:
      return planar(rng);
    case RobotKind::kWrist:
      return slider_wrist(rng);
  }
  return {};
}

KinematicTree tree_of(const std::vector<JointPlan>& plan) {
  KinematicTree tree;
  tree.links.push_back({"base"});
  for (std::size_t j = 0; j < plan.size(); ++j) {
    Joint joint;
    joint.name = fmt::format("q{}", j + 1);
    joint.channel = joint.name;
    joint.type = plan[j].type;
    joint.parent = LinkId{plan[j].parent};
    joint.child = LinkId{static_cast<int>(j) + 1};
    joint.T_parent_joint = plan[j].T_parent_joint;
    tree.joints.push_back(joint);
    tree.links.push_back({fmt::format("link{}", j + 1)});
  }
  return tree;
}

std::vector<Pose> middle_posture(const KinematicTree& tree) {
  return forward_kinematics(tree,
                            Eigen::VectorXd::Zero(static_cast<Eigen::Index>(tree.joints.size())));
}

// Looks at the robot's middle from above the horizon.
Pose place_camera(const KinematicTree& tree, double distance_m, Rng& rng) {
  const double elevation = rng.uniform(0.3, 0.9);
  // Base z up in the image (-y), then leant towards the camera.
  Pose T;
  T.rotation = exp_rotation({0.0, 0.0, rng.normal(0.05)}) *
               exp_rotation({0.5 * std::numbers::pi + elevation, 0.0, 0.0}) *
               exp_rotation({0.0, 0.0, rng.uniform(-std::numbers::pi, std::numbers::pi)});
  const std::vector<Pose> links = middle_posture(tree);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Pose& link : links) middle += link.translation / static_cast<double>(links.size());
  T.translation = Eigen::Vector3d(0.0, 0.0, distance_m) - T.rotation * middle;
  return T;
}

// Tags face the camera in the middle posture, tilted, so that they are seen most of the time.
void mount_tags(const FilmedRobotOptions& options, Rng& rng, FilmedRobot& robot) {
  const std::vector<Pose> links = middle_posture(robot.tree);
  for (std::size_t l = 0; l < links.size(); ++l) {
    const Pose T_camera_link = robot.T_camera_base * links[l];
    const double direction = rng.uniform(-std::numbers::pi, std::numbers::pi);
    const double tilt = rng.uniform(0.2, 0.5);
    Pose T_camera_tag;
    T_camera_tag.rotation =
        exp_rotation({tilt * std::cos(direction), tilt * std::sin(direction), 0.0}) *
        exp_rotation({0.0, 0.0, rng.uniform(-std::numbers::pi, std::numbers::pi)});
    T_camera_tag.translation = T_camera_link.translation + rng.unit3() * 0.03;
    Marker marker;
    marker.id = TagId{static_cast<int>(l) + 10};
    marker.link = LinkId{static_cast<int>(l)};
    marker.T_link_marker = T_camera_link.inverse() * T_camera_tag;
    marker.size_m = options.tag_size_m;
    robot.tree.markers.push_back(marker);
  }
}

}  // namespace

std::string_view to_string(RobotKind kind) {
  switch (kind) {
    case RobotKind::kArm3:
      return "arm3";
    case RobotKind::kArm6:
      return "arm6";
    case RobotKind::kScara:
      return "scara";
    case RobotKind::kGantry:
      return "gantry";
    case RobotKind::kTree:
      return "tree";
    case RobotKind::kArm7:
      return "arm7";
    case RobotKind::kPlanar:
      return "planar";
    case RobotKind::kWrist:
      return "wrist";
  }
  return "";
}

std::vector<double> instants(double duration_s, double step_s) {
  std::vector<double> out(static_cast<std::size_t>(duration_s / step_s) + 1);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = static_cast<double>(i) * step_s;
  return out;
}

SmoothMotion::SmoothMotion(double reach, const FilmedRobotOptions& options, Rng& rng)
    : rest_s_(options.rest_s), duration_s_(options.duration_s) {
  for (Sine& sine : sines_) {
    sine.amplitude = rng.uniform(0.4, 1.0);
    sine.omega = 2.0 * std::numbers::pi * rng.uniform(options.lowest_hz, options.highest_hz);
    sine.phase = rng.uniform(0.0, 2.0 * std::numbers::pi);
  }
  double peak = 0.0;
  for (const double t : instants(options.duration_s, 0.01))
    peak = std::max(peak, std::abs(value(t)));
  for (Sine& sine : sines_) sine.amplitude *= reach / peak;
}

double SmoothMotion::phase_s(double t_s) const {
  if (rest_s_ <= 0.0) return t_s;
  // Constant acceleration over a second, so that the start is no jerk.
  const auto since = [](double t) { return t <= 0.0 ? 0.0 : t < 1.0 ? 0.5 * t * t : t - 0.5; };
  return since(t_s - rest_s_) - since(t_s - (duration_s_ - rest_s_ - 1.0));
}

double SmoothMotion::pace(double t_s) const {
  if (rest_s_ <= 0.0) return 1.0;
  const auto since = [](double t) { return std::clamp(t, 0.0, 1.0); };
  return since(t_s - rest_s_) - since(t_s - (duration_s_ - rest_s_ - 1.0));
}

double SmoothMotion::value(double t_s) const {
  double sum = 0.0;
  const double t = phase_s(t_s);
  for (const Sine& s : sines_) sum += s.amplitude * std::sin(s.omega * t + s.phase);
  return sum;
}

double SmoothMotion::rate(double t_s) const {
  double sum = 0.0;
  const double t = phase_s(t_s);
  for (const Sine& s : sines_) sum += s.amplitude * s.omega * std::cos(s.omega * t + s.phase);
  return sum * pace(t_s);
}

Eigen::VectorXd FilmedRobot::encoders(double t_s) const {
  Eigen::VectorXd out(static_cast<Eigen::Index>(motions.size()));
  for (Eigen::Index j = 0; j < out.size(); ++j) {
    out[j] = motions[static_cast<std::size_t>(j)].value(t_s);
  }
  return out;
}

FilmedRobot draw_filmed_robot(const FilmedRobotOptions& options) {
  Rng rng = Rng::from_name(fmt::format("filmed robot {}", to_string(options.kind)), options.seed);
  FilmedRobot robot;
  robot.duration_s = options.duration_s;
  robot.last_frame_s = options.duration_s;
  robot.rest_s = options.rest_s;
  robot.prismatic_m_per_rad = options.scale * options.prismatic_m_per_rad;
  robot.seed = options.seed;
  robot.down = options.down.normalized();
  robot.camera = pinhole_guess(1280, 720, 900.0);
  robot.camera.distortion = {-0.08, 0.03, 0.0005, -0.0004, 0.0};
  robot.markers.default_size_m = options.tag_size_m;
  robot.tree = tree_of(plan_of(options.kind, rng));
  for (Joint& joint : robot.tree.joints) joint.T_parent_joint.translation *= options.scale;
  robot.T_camera_base = place_camera(robot.tree, options.distance_m, rng);
  mount_tags(options, rng, robot);
  for (const Joint& joint : robot.tree.joints) {
    const double unit = joint.type == JointType::kPrismatic ? robot.prismatic_m_per_rad : 1.0;
    robot.motions.emplace_back(unit * options.amplitude_rad, options, rng);
  }
  return robot;
}

}  // namespace kinescope::truth
