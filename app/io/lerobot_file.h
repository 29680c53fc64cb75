// SPDX-License-Identifier: Apache-2.0
//
// Takes   the calibration file that LeRobot's drivers keep of an arm: of every motor its id,
//         drive_mode, homing_offset, range_min and range_max (counts, 4096 a turn).
// Gives   its motors, how a count becomes the value that a dataset has, and the same file with
//         other ranges.
// Method  as LeRobot normalises (lerobot/motors/motors_bus.py, MotorNormMode): degrees from the
//         middle of the range, or per cent of it (-100 to 100; a gripper's 0 to 100).
// Not here: which ranges are right (app/commands/export_lerobot.cpp).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace kinescope {

struct LerobotMotor {
  std::string name;
  int drive_mode = 0;
  int range_min = 0;  ///< count
  int range_max = 0;  ///< count, above range_min
};

/// LeRobot's MotorNormMode.
enum class LerobotValues { kDegrees, kPercent, kHundred };

/// "degrees", "percent" (-100 to 100), "hundred" (0 to 100).
[[nodiscard]] std::string_view to_string(LerobotValues values);

/// Of the servos that these arms have (Feetech STS3215, Dynamixel XL330, XL430): 12 bits.
inline constexpr double kCountsPerTurn = 4096.0;

/// How far a motor's shaft turns for one unit of its value, degrees. Positive.
[[nodiscard]] double degrees_per_unit(const LerobotMotor& motor, LerobotValues values);
/// The count at which the driver gives the value, with drive_mode 0.
[[nodiscard]] double count_at(const LerobotMotor& motor, LerobotValues values, double value);

struct LerobotCalibration {
  nlohmann::ordered_json document;  ///< as it was read: keys in their order
  std::vector<LerobotMotor> motors;

  [[nodiscard]] const LerobotMotor* motor(std::string_view name) const;
  /// Throws std::out_of_range for a motor that is not there.
  void set_range(const std::string& name, int range_min, int range_max);
  /// As LeRobot writes it.
  [[nodiscard]] std::string text() const;
};

/// Throws bad_input that names file and motor: no such file, no JSON, the layout of before 2025,
/// numbers that are none, a range that is none or beyond a turn.
[[nodiscard]] LerobotCalibration read_lerobot_calibration(const std::filesystem::path& path);
[[nodiscard]] LerobotCalibration parse_lerobot_calibration(std::string_view text,
                                                           const std::string& source);

}  // namespace kinescope
