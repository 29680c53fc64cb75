// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/rotation_between.h"

#include <cmath>

namespace kinescope {
namespace {

// Cosines below this leave fewer than half of the digits of 1 + cosine (1.4e-6 rad from opposite).
constexpr double kOpposite = -1.0 + 1e-12;
// Sine of the angle below which the product of the two unit vectors is mostly rounding.
constexpr double kNoAxis = 1e-10;

// Unit vectors that are not opposite: half the angle's cosine is |a + b| / 2.
Eigen::Quaterniond regular(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d axis = a.cross(b);
  const double s = std::sqrt(2.0 * (1.0 + a.dot(b)));
  Eigen::Quaterniond out;
  out.vec() = axis / s;
  out.w() = 0.5 * s;
  return out.normalized();
}

}  // namespace

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized();
  const Eigen::Vector3d b = to.normalized();
  if (!(a.dot(b) < kOpposite)) return regular(a, b);
  // A half turn to -a about the same axis, and the rest.
  Eigen::Vector3d axis = a.cross(b);
  if (axis.norm() < kNoAxis) axis = a.unitOrthogonal().cross(a);
  axis = (axis - a.dot(axis) * a).normalized();
  const Eigen::Quaterniond half_turn(0.0, axis.x(), axis.y(), axis.z());
  return (regular(-a, b) * half_turn).normalized();
}

}  // namespace kinescope
