// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/injected_effect.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "tests/truth/mechanics.h"

namespace kinescope::truth {
namespace {

constexpr double kFocal = 900.0;  // px, of the worlds' camera

// What one degree of an angle's effect is: in radians on a revolute joint, in metres on a slide.
enum class Unit { kPlain, kAngle };

struct Strength {
  std::string_view effect;
  double size = 0.0;  ///< angles: rad, and on slides as many times the world's m per rad
  Unit kind = Unit::kPlain;
};

constexpr std::array<Strength, 36> kWeakest{{
    {"time_offset", 0.5e-3},
    {"clock_drift", 5e-5},  // 0.5 ms rms over 33 s
    {"encoder_scale", 500e-6},
    {"eccentricity", 0.03 * kRadPerDegree},
    {"gear_error", 0.03 * kRadPerDegree, Unit::kAngle},
    {"backlash", 0.05 * kRadPerDegree, Unit::kAngle},
    {"compliance", 0.03 * kRadPerDegree, Unit::kAngle},
    {"coupling", 0.002},
    {"helical", 0.05e-3},
    {"curved_slider", 0.005},  // turns the carriage by 0.03 deg at the end of 0.1 m
    {"axis_wobble", 0.03 * kRadPerDegree},
    {"lens_distortion", 0.002},
    {"intrinsics", 2e-3},
    {"bent_tag", 0.03e-3},
    {"quantisation", 0.06 * kRadPerDegree, Unit::kAngle},  // 0.017 deg rms
    {"rolling_shutter", 1e-6},
    {"tag_size", 1e-3},  // 0.05 mm of 50 mm
    {"tag_slip", 0.3e-3},
    {"camera_bump", 0.3 / kFocal},
    {"camera_drift", 0.6 / kFocal},
    {"zero_jump", 0.03 * kRadPerDegree, Unit::kAngle},
    {"zero_drift", 0.06 * kRadPerDegree, Unit::kAngle},
    {"clock_jump", 1e-3},
    {"own_tanh", 0.03 * kRadPerDegree, Unit::kAngle},
    {"own_speed", 0.06 * kRadPerDegree, Unit::kAngle},
    {"own_chequer", 0.03},
    {"own_ripple", 0.03},
    {"own_product", 0.06 * kRadPerDegree, Unit::kAngle},
    {"own_acceleration", 0.06 * kRadPerDegree, Unit::kAngle},
    {"own_vibration", 0.03 * kRadPerDegree, Unit::kAngle},
    {"own_creep", 0.03 * kRadPerDegree, Unit::kAngle},
    {"blooming", 0.03},
    {"thermal_growth", 0.15e-3},
    {"focal_jump", 0.5e-3},
    {"focal_drift", 1e-3},
    {"own_hunting", 0.5e-3},
}};

constexpr std::array<std::string_view, 19> kOnJoints{
    "encoder_scale", "eccentricity", "gear_error",   "backlash",      "compliance",
    "coupling",      "helical",      "axis_wobble",  "curved_slider", "zero_jump",
    "zero_drift",    "own_tanh",     "own_speed",    "own_product",   "own_acceleration",
    "own_vibration", "own_creep",    "quantisation", "own_cubic"};
constexpr std::array<std::string_view, 5> kAtATime{"tag_slip", "camera_bump", "zero_jump",
                                                   "clock_jump", "focal_jump"};
constexpr std::array<std::string_view, 4> kCreeping{"camera_drift", "zero_drift", "thermal_growth",
                                                    "focal_drift"};
constexpr std::array<std::string_view, 6> kByAnother{
    "coupling", "own_tanh", "own_speed", "own_product", "own_acceleration", "own_creep"};
constexpr std::array<std::string_view, 3> kOnRevolute{"eccentricity", "helical", "axis_wobble"};
// A load that hardly changes sags by an offset, which is the joint's zero.
constexpr double kChangingLoad = 0.3;

bool among(const auto& names, std::string_view name) {
  return std::ranges::find(names, name) != names.end();
}

const Strength& strength_of(std::string_view effect) {
  const auto found = std::ranges::find(kWeakest, effect, &Strength::effect);
  if (found == kWeakest.end()) throw std::logic_error("an effect has a known name");
  return *found;
}

// Details that differ from place to place and robot to robot.
double detail_of(std::string_view effect, const Joint* joint, Rng& rng) {
  if (effect == "clock_drift" || effect == "rolling_shutter") return 0.5;
  if (effect == "eccentricity") return 1.0 + rng.index(2);
  if (effect == "axis_wobble") return -1.0;
  if (among(kAtATime, effect)) return rng.uniform(0.25, 0.75);
  if (among(kCreeping, effect)) return rng.uniform(0.2, 2.0);
  if (effect == "own_chequer" || effect == "own_ripple") return rng.uniform(60.0, 120.0);
  if (effect == "bent_tag") return rng.uniform(0.2, 1.4);
  if (effect == "own_vibration") return rng.uniform(2.0, 6.0);
  if (effect == "own_hunting") return rng.uniform(0.1, 0.4);
  if (effect != "gear_error") return 0.0;
  return joint->type == JointType::kPrismatic ? rng.uniform(15.0, 60.0) : rng.uniform(6.0, 40.0);
}

bool load_changes(const FilmedRobot& robot, std::size_t joint) {
  const TorqueRange range = gravity_range(robot, joint);
  return range.highest - range.lowest > kChangingLoad * range.largest();
}

std::vector<InjectedEffect> on_joint(std::string_view effect, const FilmedRobot& robot,
                                     std::size_t j) {
  const Strength& strength = strength_of(effect);
  const auto unit = [&robot](const Joint& joint) {
    return joint.type == JointType::kPrismatic ? robot.prismatic_m_per_rad : 1.0;
  };
  const Joint& joint = robot.tree.joints[j];
  if (!can_have(joint.type, effect)) return {};
  if (effect == "compliance" && !load_changes(robot, j)) return {};
  Rng rng = Rng::from_name(fmt::format("weakest {} {}", effect, joint.name), robot.seed);
  InjectedEffect out{std::string(effect), joint.name, strength.size,
                     detail_of(effect, &joint, rng)};
  if (strength.kind == Unit::kAngle) out.size *= unit(joint);
  if (!among(kByAnother, effect)) return {out};
  std::vector<InjectedEffect> pairs;
  for (const Joint& other : robot.tree.joints) {
    if (other.name == joint.name) continue;
    out.with = other.name;
    if (effect == "coupling") out.size = strength.size * unit(joint) / unit(other);
    pairs.push_back(out);
  }
  return pairs;
}

}  // namespace

const std::vector<std::string>& library_effects() {
  static const std::vector<std::string> names{
      "time_offset",   "clock_drift",     "encoder_scale",   "eccentricity",   "gear_error",
      "backlash",      "compliance",      "coupling",        "helical",        "axis_wobble",
      "curved_slider", "lens_distortion", "rolling_shutter", "tag_size",       "tag_slip",
      "camera_bump",   "camera_drift",    "zero_jump",       "zero_drift",     "clock_jump",
      "intrinsics",    "bent_tag",        "quantisation",    "thermal_growth", "blooming",
      "focal_jump",    "focal_drift"};
  return names;
}

const std::vector<std::string>& own_effects() {
  static const std::vector<std::string> names{"own_tanh",      "own_speed",   "own_chequer",
                                              "own_ripple",    "own_product", "own_acceleration",
                                              "own_vibration", "own_creep",   "own_hunting"};
  return names;
}

std::string place_in_library(const InjectedEffect& effect) {
  if (effect.place != "camera") return effect.place;
  if (effect.effect == "intrinsics")
    return effect.with.empty() ? "camera focal length" : "camera " + effect.with;
  return effect.with.empty() ? effect.place : effect.place + " " + effect.with;
}

bool sits_on_joint(std::string_view effect) { return among(kOnJoints, effect); }

bool is_late_joint(const InjectedEffect& effect) {
  return effect.effect == "time_offset" && effect.place != "clock";
}

bool is_mechanical(const InjectedEffect& effect) {
  if (effect.effect == "quantisation") return false;
  return sits_on_joint(effect.effect) || is_late_joint(effect);
}

double creep(double t_s, double time_constant_s, double last_s) {
  return std::expm1(-t_s / time_constant_s) / std::expm1(-last_s / time_constant_s);
}

bool can_have(JointType type, std::string_view effect) {
  if (type == JointType::kFixed || !sits_on_joint(effect)) return false;
  if (effect == "curved_slider") return type == JointType::kPrismatic;
  return type == JointType::kRevolute || !among(kOnRevolute, effect);
}

std::string_view size_unit(std::string_view effect, JointType type) {
  if (effect == "time_offset" || effect == "clock_jump" || effect == "rolling_shutter") return "s";
  if (effect == "clock_drift") return "s/s";
  if (effect == "helical" || effect == "tag_slip" || effect == "bent_tag") return "m";
  if (effect == "curved_slider") return "1/m";
  if (effect == "axis_wobble" || effect.starts_with("camera_")) return "rad";
  if (effect == "own_chequer" || effect == "own_ripple" || effect == "blooming") return "px";
  if (effect == "encoder_scale" || effect == "coupling" || !sits_on_joint(effect)) return "";
  return type == JointType::kPrismatic ? "m" : "rad";
}

std::vector<InjectedEffect> weakest_effects(std::string_view effect, const FilmedRobot& robot) {
  std::vector<InjectedEffect> out;
  if (sits_on_joint(effect)) {
    for (std::size_t j = 0; j < robot.tree.joints.size(); ++j) {
      std::ranges::move(on_joint(effect, robot, j), std::back_inserter(out));
    }
    return out;
  }
  std::vector<std::string> places;
  if (effect.starts_with("tag_") || effect == "bent_tag") {
    for (const Marker& marker : robot.tree.markers) {
      // A tag that never moves may as well be larger and further away.
      if (effect != "tag_slip" && marker.link == LinkId{0}) continue;
      places.push_back(fmt::format("tag_{}", marker.id.value));
    }
    const auto slides = std::ranges::count(robot.tree.joints, JointType::kPrismatic, &Joint::type);
    if (effect == "tag_size" && slides > 1) places.emplace_back("tags");
  } else {
    const bool is_of_clock = effect == "time_offset" || effect.starts_with("clock_");
    places.emplace_back(is_of_clock ? "clock" : effect == "thermal_growth" ? "robot" : "camera");
    if (effect == "time_offset" && robot.tree.joints.size() > 1) {
      for (const Joint& joint : robot.tree.joints) places.push_back(joint.name);
    }
  }
  for (const std::string& place : places) {
    Rng rng = Rng::from_name(fmt::format("weakest {} {}", effect, place), robot.seed);
    out.push_back(
        {std::string(effect), place, strength_of(effect).size, detail_of(effect, nullptr, rng)});
    if (effect != "intrinsics") continue;
    constexpr double kWeakestShift = 2.0;  // px
    out.push_back({std::string(effect), place, kWeakestShift, 0.0, "centre"});
  }
  return out;
}

}  // namespace kinescope::truth
