// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/mechanics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope::truth {
namespace {

constexpr double kBefore = 2.0;    // s, in which play forgets where it began
constexpr double kStep = 0.0005;   // s, of the play's memory
constexpr double kGravity = 9.81;  // m/s^2
constexpr double kCreep = 1.5;     // s
constexpr double kFullTurn = 2.0 * std::numbers::pi;

std::size_t joint_named(const KinematicTree& tree, const std::string& name) {
  const auto joint = tree.joint(name);
  KINESCOPE_CHECK(joint.has_value(), "an effect sits on a joint of the robot");
  return joint->index();
}

// The head stands at angle 0 and distance 1; the disc's centre goes round the shaft at `off`. What
// the head reads against what the shaft does, solved for the shaft.
double shaft_of_eccentric_disc(double reading, double off, double phase) {
  double shaft = reading;
  for (int i = 0; i < 20; ++i) {
    const double a = shaft + phase;
    shaft = reading - std::atan2(off * std::sin(a), 1.0 - off * std::cos(a));
  }
  return shaft;
}

// Angle behind a universal joint bent by `bend`: tan(out) = tan(in) cos(bend), on the branch of in.
double behind_universal_joint(double in, double bend) {
  return in + std::atan2((std::cos(bend) - 1.0) * std::sin(in) * std::cos(in),
                         std::pow(std::cos(in), 2) + std::cos(bend) * std::pow(std::sin(in), 2));
}

// Bend of a universal joint whose output swings by `amplitude`: sin(amplitude) = tan(bend / 2)^2.
double bend_for(double amplitude) { return 2.0 * std::atan(std::sqrt(std::sin(amplitude))); }

Eigen::Vector3d across(double direction) { return {std::cos(direction), std::sin(direction), 0.0}; }

double largest_rate(const FilmedRobot& robot, std::size_t joint) {
  double largest = 0.0;
  for (const double t : instants(robot.duration_s, 0.01))
    largest = std::max(largest, std::abs(robot.motions[joint].rate(t)));
  return largest;
}

double largest_value(const FilmedRobot& robot, std::size_t joint) {
  double largest = 0.0;
  for (const double t : instants(robot.duration_s, 0.01))
    largest = std::max(largest, std::abs(robot.motions[joint].value(t)));
  return largest;
}

// On a circle of the given curvature in the plane of z and `side`, turned with the tangent.
Pose along_circle(double travel, double curvature, const Eigen::Vector3d& side) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const double turn = travel * curvature;
  Pose T;
  T.rotation = exp_rotation(z.cross(side) * turn);
  T.translation = (z * std::sin(turn) + side * (1.0 - std::cos(turn))) / curvature;
  return T;
}

// Laws that need nothing but the joint's own encoder.
Mechanics::Law encoder_law(const InjectedEffect& effect, bool turns, double phase) {
  const double size = effect.size;
  const double detail = effect.detail;
  if (effect.effect == "encoder_scale") {
    return [size](double q, const auto&, double) { return q * (1.0 + size); };
  }
  if (effect.effect == "eccentricity" && detail == 2.0) {
    return [bend = bend_for(size), phase](double q, const auto&, double) {
      return behind_universal_joint(q + phase, bend) - phase;
    };
  }
  if (effect.effect == "eccentricity") {
    // The reading strays by asin(off) at most.
    return [off = std::sin(size), phase](double q, const auto&, double) {
      return shaft_of_eccentric_disc(q, off, phase);
    };
  }
  if (effect.effect == "gear_error") {
    // Periods a turn are radians of error a radian of the joint; on a slide, periods a metre.
    const double wave = turns ? detail : kFullTurn * detail;
    return [=](double q, const auto&, double) { return q + size * std::sin(wave * q + phase); };
  }
  return {};
}

// Laws that need nothing but the time.
Mechanics::Law law_of_time(const InjectedEffect& effect, const FilmedRobot& robot, double phase) {
  const double size = effect.size;
  if (effect.effect == "zero_jump") {
    return [size, at_s = effect.detail * robot.duration_s](double q, const auto&, double t) {
      return q + (t >= at_s ? size : 0.0);
    };
  }
  if (effect.effect == "zero_drift") {
    return [size, constant_s = effect.detail * robot.duration_s, last_s = robot.last_frame_s](
               double q, const auto&, double t) { return q + size * creep(t, constant_s, last_s); };
  }
  if (effect.effect == "own_vibration") {
    return [=, omega = kFullTurn * effect.detail](double q, const auto&, double t) {
      return q + size * std::sin(omega * t + phase);
    };
  }
  return {};
}

Mechanics::Law law_of(const InjectedEffect& effect, const FilmedRobot& robot, std::size_t joint,
                      double phase) {
  const bool turns = robot.tree.joints[joint].type == JointType::kRevolute;
  if (Mechanics::Law law = law_of_time(effect, robot, phase)) return law;
  if (Mechanics::Law law = encoder_law(effect, turns, phase)) return law;
  const double size = effect.size;
  if (effect.effect == "own_cubic") {
    const double reach = largest_value(robot, joint);
    return [=](double q, const auto&, double) { return q + size * std::pow(q / reach, 3); };
  }
  const std::size_t other = joint_named(robot.tree, effect.with);
  const auto k = static_cast<Eigen::Index>(other);
  if (effect.effect == "coupling") {
    return
        [=](double q, const Eigen::VectorXd& encoders, double) { return q + size * encoders[k]; };
  }
  if (effect.effect == "own_tanh") {
    const double slope = 5.0 / largest_value(robot, other);
    return [=, middle = effect.detail](double q, const Eigen::VectorXd& encoders, double) {
      return q + size * std::tanh(slope * (encoders[k] - middle));
    };
  }
  if (effect.effect == "own_product") {
    const auto own = static_cast<Eigen::Index>(joint);
    const double factor = size / (largest_value(robot, joint) * largest_value(robot, other));
    return [=](double q, const Eigen::VectorXd& encoders, double) {
      return q + factor * encoders[own] * encoders[k];
    };
  }
  const SmoothMotion& motion = robot.motions[other];
  if (effect.effect == "own_acceleration") {
    const auto acceleration = [&motion](double t) {
      constexpr double kHalfStep = 1e-3;  // s
      return (motion.rate(t + kHalfStep) - motion.rate(t - kHalfStep)) / (2.0 * kHalfStep);
    };
    double largest = 0.0;
    for (const double t : instants(robot.duration_s, 0.01))
      largest = std::max(largest, std::abs(acceleration(t)));
    return [=](double q, const auto&, double t) { return q + size * acceleration(t) / largest; };
  }
  if (effect.effect == "own_creep") {
    const Creep creep(motion, kCreep, robot.duration_s);
    const double factor = size / largest_value(robot, other);
    return [=](double q, const Eigen::VectorXd& encoders, double t) {
      return q + factor * (creep.value(t) - encoders[k]);
    };
  }
  KINESCOPE_CHECK(effect.effect == "own_speed", "an effect of a joint has a known name");
  const double factor = size / std::pow(largest_rate(robot, other), 2);
  return [factor, &motion](double q, const auto&, double t) {
    return q + factor * std::pow(motion.rate(t), 2);
  };
}

// Empty for effects that change a joint's value and not its motion.
Mechanics::Motion motion_of(const InjectedEffect& effect, double phase,
                            const Mechanics::Motion& before) {
  const double size = effect.size;
  if (effect.effect == "helical") {
    return [=](double q) {
      return Pose{{1.0, 0.0, 0.0, 0.0}, {0.0, 0.0, size * q / kFullTurn}} * before(q);
    };
  }
  if (effect.effect == "curved_slider") {
    if (size == 0.0) return before;
    return [size, side = across(phase)](double q) { return along_circle(q, size, side); };
  }
  if (effect.effect == "axis_wobble") {
    KINESCOPE_CHECK(effect.detail != 0.0 && effect.detail != 1.0, "a wobble is no other geometry");
    return [=, turns = effect.detail](double q) {
      return Pose{exp_rotation(across(turns * q + phase) * size), Eigen::Vector3d::Zero()} *
             before(q);
    };
  }
  return {};
}

}  // namespace

Play::Play(const SmoothMotion& leader, double width, double duration_s, double start)
    : leader_(leader), half_width_(0.5 * width) {
  double held = leader_.value(-kBefore) + start * half_width_;
  const auto steps = static_cast<std::size_t>((duration_s + 2.0 * kBefore) / kStep);
  for (std::size_t i = 0; i <= steps; ++i) {
    const double q = leader_.value(static_cast<double>(i) * kStep - kBefore);
    held = std::clamp(held, q - half_width_, q + half_width_);
    held_.push_back(held);
  }
}

double Play::value(double t_s) const {
  const double at = std::clamp((t_s + kBefore) / kStep, 0.0, static_cast<double>(held_.size() - 1));
  const double q = leader_.value(t_s);
  return std::clamp(held_[static_cast<std::size_t>(at)], q - half_width_, q + half_width_);
}

Creep::Creep(const SmoothMotion& leader, double time_constant_s, double duration_s) {
  double held = leader.value(-kBefore);
  const auto steps = static_cast<std::size_t>((duration_s + 2.0 * kBefore) / kStep);
  for (std::size_t i = 0; i <= steps; ++i) {
    held_.push_back(held);
    const double q = leader.value(static_cast<double>(i) * kStep - kBefore);
    held += (q - held) * kStep / time_constant_s;
  }
}

double Creep::value(double t_s) const {
  const double at = std::clamp((t_s + kBefore) / kStep, 0.0, static_cast<double>(held_.size() - 1));
  return held_[static_cast<std::size_t>(at)];
}

Masses::Masses(const KinematicTree& tree, std::uint64_t seed) {
  Rng rng = Rng::from_name("masses of a filmed robot", seed);
  for (std::size_t l = 1; l < tree.links.size(); ++l) {
    const double mass_kg = rng.uniform(0.5, 2.0);
    masses_.push_back({l, mass_kg, rng.unit3() * rng.uniform(0.03, 0.12)});
    const bool last = std::ranges::none_of(
        tree.joints, [l](const Joint& joint) { return joint.parent.index() == l; });
    const double payload_kg = rng.uniform(0.3, 1.0);
    const Eigen::Vector3d place_m = rng.unit3() * rng.uniform(0.05, 0.15);
    if (last) masses_.push_back({l, payload_kg, place_m});
  }
}

Eigen::VectorXd Masses::torques(const KinematicTree& tree, const Eigen::VectorXd& values,
                                const Eigen::Vector3d& down) const {
  const std::vector<Pose> links = forward_kinematics(tree, values);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(values.size());
  for (const Mass& mass : masses_) {
    const Eigen::Vector3d place = links[mass.link] * mass.place_m;
    const Eigen::Vector3d weight = mass.mass_kg * kGravity * down;
    for (const JointId id : tree.path_to(LinkId{static_cast<int>(mass.link)})) {
      const Joint& joint = tree.joints[id.index()];
      const Pose& T_base_link = links[joint.child.index()];
      const Eigen::Vector3d axis = T_base_link.rotation * joint.axis;
      out[id.value] += joint.type == JointType::kPrismatic
                           ? axis.dot(weight)
                           : axis.cross(place - T_base_link.translation).dot(weight);
    }
  }
  return out;
}

double Masses::work_of_falling(const KinematicTree& tree, const Eigen::VectorXd& values,
                               const Eigen::Vector3d& down) const {
  const std::vector<Pose> links = forward_kinematics(tree, values);
  double work = 0.0;
  for (const Mass& mass : masses_) {
    work += mass.mass_kg * kGravity * down.dot(links[mass.link] * mass.place_m);
  }
  return work;
}

double TorqueRange::largest() const { return std::max(std::abs(lowest), std::abs(highest)); }

TorqueRange gravity_range(const FilmedRobot& robot, std::size_t joint) {
  const Masses masses(robot.tree, robot.seed);
  TorqueRange range{std::numeric_limits<double>::infinity(),
                    -std::numeric_limits<double>::infinity()};
  for (const double t : instants(robot.duration_s, 0.05)) {
    const Eigen::VectorXd torques = masses.torques(robot.tree, robot.encoders(t), robot.down);
    const double torque = torques[static_cast<Eigen::Index>(joint)];
    range.lowest = std::min(range.lowest, torque);
    range.highest = std::max(range.highest, torque);
  }
  return range;
}

Mechanics::Mechanics(const FilmedRobot& robot, const std::vector<InjectedEffect>& effects)
    : robot_(robot),
      masses_(robot.tree, robot.seed),
      plays_(robot.tree.joints.size()),
      laws_(robot.tree.joints.size()) {
  for (const Joint& joint : robot.tree.joints) {
    motions_.emplace_back(
        [&joint](double value) { return joint_motion(joint.type, joint.axis, value); });
  }
  for (const InjectedEffect& effect : effects) {
    if (is_mechanical(effect)) add(effect);
  }
}

void Mechanics::add(const InjectedEffect& effect) {
  Rng rng = Rng::from_name(fmt::format("injected {} {}", effect.effect, effect.place), robot_.seed);
  const double phase = rng.uniform(0.0, kFullTurn);
  const std::size_t j = joint_named(robot_.tree, effect.place);
  if (is_late_joint(effect)) {
    laws_[j].push_back(
        [&motion = robot_.motions[j], late_s = effect.size](double q, const auto&, double t) {
          return q + motion.value(t + late_s) - motion.value(t);
        });
    return;
  }
  KINESCOPE_CHECK(can_have(robot_.tree.joints[j].type, effect.effect),
                  "an effect sits on a joint that can have it");
  if (effect.effect == "backlash") {
    // A robot that rests at first may rest anywhere in its gap.
    const double start = robot_.rest_s > 0.0 ? rng.uniform(-1.0, 1.0) : 0.0;
    plays_[j].emplace(robot_.motions[j], effect.size, robot_.duration_s, start);
  } else if (effect.effect == "compliance") {
    const double largest = gravity_range(robot_, j).largest();
    KINESCOPE_CHECK(largest > 0.0, "gravity acts on a joint that sags");
    sags_.push_back({static_cast<Eigen::Index>(j), effect.size / largest});
  } else if (Motion motion = motion_of(effect, phase, motions_[j])) {
    motions_[j] = std::move(motion);
  } else {
    laws_[j].push_back(law_of(effect, robot_, j, phase));
  }
}

Eigen::VectorXd Mechanics::values(double t_s) const {
  const Eigen::VectorXd encoders = robot_.encoders(t_s);
  Eigen::VectorXd values = encoders;
  for (Eigen::Index j = 0; j < values.size(); ++j) {
    const auto k = static_cast<std::size_t>(j);
    if (const auto& play = plays_[k]) values[j] = play->value(t_s);
    for (const Law& law : laws_[k]) values[j] = law(values[j], encoders, t_s);
  }
  if (sags_.empty()) return values;
  // The torque that counts is that of the posture the robot sags to.
  Eigen::VectorXd sagged = values;
  for (int i = 0; i < 4; ++i) {
    const Eigen::VectorXd torques = masses_.torques(robot_.tree, sagged, robot_.down);
    sagged = values;
    for (const Sag& sag : sags_) sagged[sag.joint] += sag.compliance * torques[sag.joint];
  }
  return sagged;
}

std::vector<Pose> Mechanics::links(double t_s) const {
  const Eigen::VectorXd now = values(t_s);
  std::vector<Pose> T_base_link(robot_.tree.links.size());
  for (std::size_t j = 0; j < robot_.tree.joints.size(); ++j) {
    const Joint& joint = robot_.tree.joints[j];
    T_base_link[joint.child.index()] = T_base_link[joint.parent.index()] * joint.T_parent_joint *
                                       motions_[j](now[static_cast<Eigen::Index>(j)]);
  }
  return T_base_link;
}

}  // namespace kinescope::truth
