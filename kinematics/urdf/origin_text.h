// SPDX-License-Identifier: Apache-2.0
//
// A pose as URDF writes it.
#pragma once

#include <string>

#include "kinematics/core/pose.h"

namespace kinescope::urdf_document {

/// Fixed-axis angles about x, y, z, rad: R = Rz(yaw) Ry(pitch) Rx(roll), exact also where the pitch
/// is 90 degrees.
[[nodiscard]] Eigen::Vector3d roll_pitch_yaw(const Eigen::Quaterniond& rotation);

/// xyz=".." rpy="..", m and rad.
[[nodiscard]] std::string origin_attributes(const Pose& pose);

}  // namespace kinescope::urdf_document
