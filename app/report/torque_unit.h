// SPDX-License-Identifier: Apache-2.0
//
// What the torque of a joint that slides is measured in.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope::report {

/// The unit of one joint's torque: "N" where "Nm" is said of a joint that slides.
[[nodiscard]] inline std::string joint_unit(std::string_view torque_unit, JointType type) {
  return std::string(torque_unit == "Nm" && type == JointType::kPrismatic ? "N" : torque_unit);
}

/// The unit of a table of all joints: "Nm (N where a joint slides)".
[[nodiscard]] inline std::string common_unit(std::string_view torque_unit,
                                             const std::vector<JointType>& types) {
  std::string unit(torque_unit);
  for (const JointType type : types) {
    const std::string own = joint_unit(torque_unit, type);
    if (own == torque_unit) continue;
    unit += " (";
    unit += own;
    unit += " where a joint slides)";
    break;
  }
  return unit;
}

}  // namespace kinescope::report
