// SPDX-License-Identifier: Apache-2.0
#include "app/io/lerobot_file.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

using ordered = nlohmann::ordered_json;

constexpr const char* kCalibrateArm = "give the file that lerobot-calibrate wrote for this arm";

int whole_number_of(const ordered& motor, const char* key, const std::string& source,
                    const std::string& name, int least, int most) {
  const auto found = motor.find(key);
  if (found == motor.end() || !found->is_number_integer())
    throw bad_input(source, fmt::format("motor '{}' has no whole number '{}'", name, key),
                    kCalibrateArm);
  const double value = found->get<double>();  // whatever its size
  if (value >= least && value <= most) return static_cast<int>(value);
  throw bad_input(source,
                  fmt::format("motor '{}': {} is not from {} to {}", name, key, least, most),
                  kCalibrateArm);
}

LerobotMotor motor_of(const std::string& name, const ordered& entry, const std::string& source) {
  constexpr int kLastCount = static_cast<int>(kCountsPerTurn) - 1;
  if (!entry.is_object())
    throw bad_input(source, fmt::format("'{}' is no motor", name), kCalibrateArm);
  LerobotMotor out{name, 0, 0, 0};
  out.drive_mode = whole_number_of(entry, "drive_mode", source, name, 0, 1);
  out.range_min = whole_number_of(entry, "range_min", source, name, 0, kLastCount);
  out.range_max = whole_number_of(entry, "range_max", source, name, 0, kLastCount);
  static_cast<void>(
      whole_number_of(entry, "homing_offset", source, name, -kLastCount - 1, kLastCount + 1));
  if (out.range_min < out.range_max) return out;
  throw bad_input(
      source, fmt::format("motor '{}' has the range {} to {}", name, out.range_min, out.range_max),
      "calibrate the arm with lerobot-calibrate first: its joints were not moved");
}

}  // namespace

std::string_view to_string(LerobotValues values) {
  switch (values) {
    case LerobotValues::kDegrees:
      return "degrees";
    case LerobotValues::kPercent:
      return "percent";
    case LerobotValues::kHundred:
      return "hundred";
  }
  return "unknown";
}

double degrees_per_unit(const LerobotMotor& motor, LerobotValues values) {
  const double range_deg = (motor.range_max - motor.range_min) * 360.0 / kCountsPerTurn;
  switch (values) {
    case LerobotValues::kPercent:
      return range_deg / 200.0;
    case LerobotValues::kHundred:
      return range_deg / 100.0;
    case LerobotValues::kDegrees:
      break;
  }
  return (kCountsPerTurn - 1.0) / kCountsPerTurn;  // LeRobot divides the turn by the last count
}

double count_at(const LerobotMotor& motor, LerobotValues values, double value) {
  const double range = motor.range_max - motor.range_min;
  switch (values) {
    case LerobotValues::kPercent:
      return motor.range_min + (value + 100.0) / 200.0 * range;
    case LerobotValues::kHundred:
      return motor.range_min + value / 100.0 * range;
    case LerobotValues::kDegrees:
      break;
  }
  return (motor.range_min + motor.range_max) / 2.0 + value * (kCountsPerTurn - 1.0) / 360.0;
}

const LerobotMotor* LerobotCalibration::motor(std::string_view name) const {
  const auto found = std::ranges::find(motors, name, &LerobotMotor::name);
  return found == motors.end() ? nullptr : &*found;
}

void LerobotCalibration::set_range(const std::string& name, int range_min, int range_max) {
  ordered& entry = document.at(name);
  entry["range_min"] = range_min;
  entry["range_max"] = range_max;
  const auto found = std::ranges::find(motors, name, &LerobotMotor::name);
  found->range_min = range_min;
  found->range_max = range_max;
}

std::string LerobotCalibration::text() const { return document.dump(4) + "\n"; }

LerobotCalibration parse_lerobot_calibration(std::string_view text, const std::string& source) {
  LerobotCalibration out;
  out.document = ordered::parse(text, nullptr, false);
  if (!out.document.is_object() || out.document.empty())
    throw bad_input(source, "is no JSON with a motor a key", kCalibrateArm);
  if (out.document.contains("motor_names"))
    throw bad_input(source, "has the layout of LeRobot before 2025 (motor_names, calib_mode)",
                    "calibrate the arm with a newer LeRobot");
  for (const auto& [name, entry] : out.document.items())
    out.motors.push_back(motor_of(name, entry, source));
  return out;
}

LerobotCalibration read_lerobot_calibration(const std::filesystem::path& path) {
  return parse_lerobot_calibration(read_text_file(path), path.string());
}

}  // namespace kinescope
