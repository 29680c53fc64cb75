// SPDX-License-Identifier: Apache-2.0
//
// What the torque of a joint that slides is measured in.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope::report {

/// As the report writes it: "N m", "mN m" for the names that logs use.
[[nodiscard]] inline std::string spelled_unit(std::string_view torque_unit) {
  std::string unit(torque_unit);
  if (unit.ends_with("Nm")) unit.insert(unit.size() - 1, " ");
  return unit;
}

/// The unit of one joint's torque: "N" where "Nm" is said of a joint that slides.
[[nodiscard]] inline std::string joint_unit(std::string_view torque_unit, JointType type) {
  return torque_unit == "Nm" && type == JointType::kPrismatic ? "N" : spelled_unit(torque_unit);
}

/// The unit of a table of all joints: "N m (N where a joint slides)".
[[nodiscard]] inline std::string common_unit(std::string_view torque_unit,
                                             const std::vector<JointType>& types) {
  std::string unit = spelled_unit(torque_unit);
  for (const JointType type : types) {
    const std::string own = joint_unit(torque_unit, type);
    if (own == spelled_unit(torque_unit)) continue;
    unit += " (";
    unit += own;
    unit += " where a joint slides)";
    break;
  }
  return unit;
}

}  // namespace kinescope::report
