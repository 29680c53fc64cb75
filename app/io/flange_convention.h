// SPDX-License-Identifier: Apache-2.0
//
// The ways in which makers write a rotation: three or four numbers, and what they mean.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "calib/hand_eye/hypothesis.h"

namespace kinescope {

/// One way to read a row of numbers as a rotation.
struct RotationConvention {
  std::string_view name;   ///< in recording.yaml: "fixed_xyz"
  std::string_view words;  ///< "angles about fixed x, y, z"
  std::size_t columns = 0;
  /// Angles in rad, a quaternion of any length; of three columns the last number is unused.
  Eigen::Quaterniond (*read)(const Eigen::Vector4d& numbers) = nullptr;
};

[[nodiscard]] std::span<const RotationConvention> rotation_conventions();
/// Throws an internal error for a name that is not in the list.
[[nodiscard]] const RotationConvention& rotation_convention(std::string_view name);
/// Names of all conventions, for messages.
[[nodiscard]] std::vector<std::string> rotation_convention_names();

/// "flange: {rotation: zyz, unit: deg}", as it stands in recording.yaml.
[[nodiscard]] std::string to_string(const FlangeDeclaration& declaration);

}  // namespace kinescope
