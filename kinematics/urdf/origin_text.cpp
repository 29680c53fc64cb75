// SPDX-License-Identifier: Apache-2.0
#include "kinematics/urdf/origin_text.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/urdf/urdf_inertia.h"

namespace kinescope::urdf_document {

Eigen::Vector3d roll_pitch_yaw(const Eigen::Quaterniond& rotation) {
  const Eigen::Matrix3d R = rotation.normalized().toRotationMatrix();
  const double yaw = std::atan2(R(1, 0), R(0, 0));
  const double c = std::cos(yaw);
  const double s = std::sin(yaw);
  const double pitch = std::atan2(-R(2, 0), c * R(0, 0) + s * R(1, 0));
  // From the rotation that is left after the yaw, so that the product is exact also at 90 degrees.
  const double roll = std::atan2(s * R(0, 2) - c * R(1, 2), c * R(1, 1) - s * R(0, 1));
  return {roll, pitch, yaw};
}

std::string origin_attributes(const Pose& pose) {
  return fmt::format("xyz=\"{}\" rpy=\"{}\"", number_text(pose.translation),
                     number_text(roll_pitch_yaw(pose.rotation)));
}

}  // namespace kinescope::urdf_document
