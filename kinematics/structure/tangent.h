// SPDX-License-Identifier: Apache-2.0
//
// SE(3) logarithm in closed form for inner loops (kinematics/core/pose.h solves a linear system).
#pragma once

#include <cmath>

#include "kinematics/core/pose.h"

namespace kinescope::structure_search {

/// Translation part of the logarithm for a known rotation vector (any length but multiples of 2
/// pi): V^-1 p = p - w x p / 2 + c w x (w x p). Barfoot 2017, eq. 7.80 and 7.86.
[[nodiscard]] inline Eigen::Vector3d log_translation(const Eigen::Vector3d& w,
                                                     const Eigen::Vector3d& p) {
  const double squared = w.squaredNorm();
  double c = 1.0 / 12.0 + squared / 720.0;
  if (squared > 1e-4) {
    const double angle = std::sqrt(squared);
    c = (1.0 - angle * std::sin(angle) / (2.0 * (1.0 - std::cos(angle)))) / squared;
  }
  const Eigen::Vector3d wp = w.cross(p);
  return p - 0.5 * wp + c * w.cross(wp);
}

/// As log_pose().
[[nodiscard]] inline Vector6d fast_log(const Pose& pose) {
  Vector6d d;
  const Eigen::Vector3d w = log_rotation(pose.rotation);
  d << w, log_translation(w, pose.translation);
  return d;
}

}  // namespace kinescope::structure_search
