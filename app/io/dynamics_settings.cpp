// SPDX-License-Identifier: Apache-2.0
#include "app/io/dynamics_settings.h"

#include <array>

#include <fmt/format.h>

#include "app/io/nearest_name.h"
#include "app/io/yaml_value.h"

namespace kinescope {
namespace {

/// A list, or one value for all.
std::vector<YamlValue> one_or_more(const YamlValue& value, bool is_list) {
  return is_list ? value.items() : std::vector<YamlValue>{value};
}

std::vector<std::string> texts(const YamlValue& dynamics, const std::string& key) {
  std::vector<std::string> out;
  const auto value = dynamics.find(key);
  if (!value) return out;
  for (const YamlValue& item : one_or_more(*value, value->is_list())) out.push_back(item.text());
  return out;
}

std::vector<double> numbers(const YamlValue& dynamics, const std::string& key) {
  std::vector<double> out;
  const auto value = dynamics.find(key);
  if (!value) return out;
  for (const YamlValue& item : one_or_more(*value, value->is_list())) out.push_back(item.number());
  return out;
}

std::string text(const YamlValue& dynamics, const std::string& key) {
  const auto value = dynamics.find(key);
  return value ? value->text() : "";
}

double positive(const YamlValue& dynamics, const std::string& key, double fallback) {
  const auto value = dynamics.find(key);
  return value ? value->positive("leave it out for the default") : fallback;
}

/// One of an enumeration's values by its name.
template <typename Value, std::size_t count>
Value named(const YamlValue& dynamics, const std::string& key,
            const std::array<Value, count>& values, Value fallback) {
  const auto found = dynamics.find(key);
  if (!found) return fallback;
  std::vector<std::string> names;
  for (const Value value : values) {
    names.emplace_back(to_string(value));
    if (found->text() == names.back()) return value;
  }
  throw found->error(fmt::format("is '{}'", found->text()), did_you_mean(found->text(), names));
}

LogMapping read_mapping(const YamlValue& dynamics) {
  LogMapping mapping;
  mapping.time = text(dynamics, "time");
  mapping.time_unit = text(dynamics, "time_unit");
  mapping.rate_hz = positive(dynamics, "rate_hz", 0.0);
  mapping.trajectory = text(dynamics, "trajectory");
  mapping.position = texts(dynamics, "position");
  mapping.velocity = texts(dynamics, "velocity");
  mapping.acceleration = texts(dynamics, "acceleration");
  mapping.torque = texts(dynamics, "torque");
  mapping.position_unit = texts(dynamics, "position_unit");
  mapping.velocity_unit = texts(dynamics, "velocity_unit");
  mapping.acceleration_unit = texts(dynamics, "acceleration_unit");
  mapping.torque_unit = texts(dynamics, "torque_unit");
  mapping.position_factor = numbers(dynamics, "position_factor");
  mapping.torque_factor = numbers(dynamics, "torque_factor");
  if (const auto joints = dynamics.find("joints")) {
    for (const auto& [joint, logged] : joints->entries()) mapping.joints[joint] = logged.text();
  }
  return mapping;
}

MotionOptions read_motion_options(const YamlValue& dynamics) {
  using enum MotionSource;
  MotionOptions motion;
  motion.filter = named(
      dynamics, "filter",
      std::array{LowPass::kSmoothingSpline, LowPass::kButterworth, LowPass::kNone}, motion.filter);
  motion.source =
      named(dynamics, "source", std::array{kBest, kPosition, kVelocity, kLogged}, motion.source);
  motion.cutoff_hz = positive(dynamics, "cutoff_hz", motion.cutoff_hz);
  motion.rate_hz = positive(dynamics, "sample_rate_hz", motion.rate_hz);
  motion.edge_periods = positive(dynamics, "edge_periods", motion.edge_periods);
  return motion;
}

}  // namespace

TorqueDataOptions read_dynamics_settings(const std::filesystem::path& path) {
  const YamlValue file = YamlValue::read(path);
  TorqueDataOptions options;
  if (const auto dynamics = file.find("dynamics")) {
    dynamics->only_keys({"time",
                         "time_unit",
                         "rate_hz",
                         "trajectory",
                         "position",
                         "velocity",
                         "acceleration",
                         "torque",
                         "position_unit",
                         "velocity_unit",
                         "acceleration_unit",
                         "torque_unit",
                         "position_factor",
                         "torque_factor",
                         "joints",
                         "filter",
                         "source",
                         "cutoff_hz",
                         "sample_rate_hz",
                         "edge_periods",
                         "max_gap_s"});
    options.mapping = read_mapping(*dynamics);
    options.motion = read_motion_options(*dynamics);
    options.checks.max_gap_s = positive(*dynamics, "max_gap_s", options.checks.max_gap_s);
  }
  if (options.mapping.torque.empty()) options.mapping.torque = texts(file, "torques");
  return options;
}

}  // namespace kinescope
