// SPDX-License-Identifier: Apache-2.0
//
// The units that logs are written in.
#pragma once

#include <optional>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// A channel whose scale is this near to that of a known unit is in that unit; what is left is an
/// effect of the robot.
inline constexpr double kUnitTolerance = 0.05;

/// rad per degree or 1; of a joint that slides m per mm or 1. Nothing where the scale is near none.
[[nodiscard]] std::optional<double> usual_unit(JointType type, double scale,
                                               double tolerance = kUnitTolerance);

}  // namespace kinescope
