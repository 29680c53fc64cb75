// SPDX-License-Identifier: Apache-2.0
//
// Products and logarithms of poses for inner loops.
#pragma once

#include <cmath>

#include "kinematics/core/pose.h"

namespace kinescope::structure_search {

/// T_a_b * T_b_c without making the rotation unit again: its length drifts by 1e-16 a product.
[[nodiscard]] inline Pose compose(const Pose& T_a_b, const Pose& T_b_c) {
  return {T_a_b.rotation * T_b_c.rotation, T_a_b.translation + T_a_b.rotation * T_b_c.translation};
}

/// asin(s) / s by its series, exact to double precision below 0.1.
[[nodiscard]] inline double small_asin_over(double s) {
  const double x = s * s;
  return 1.0 +
         x * (1.0 / 6.0 +
              x * (3.0 / 40.0 +
                   x * (5.0 / 112.0 +
                        x * (35.0 / 1152.0 +
                             x * (63.0 / 2816.0 + x * (231.0 / 13312.0 + x * 143.0 / 10240.0))))));
}

/// As log_pose(), in closed form: the translation is V^-1 p = p - w x p / 2 + c w x (w x p) with
/// c = (1 - h cot h) / (2 h)^2 at half the angle h. Barfoot 2017, eq. 7.80 and 7.86.
[[nodiscard]] inline Vector6d fast_log(const Pose& pose) {
  const double sign = pose.rotation.w() < 0.0 ? -1.0 : 1.0;
  const double cosine = sign * pose.rotation.w();
  const Eigen::Vector3d v = sign * pose.rotation.vec();
  const double sine = v.norm();
  const double half_over_sine =
      sine < 0.1 ? small_asin_over(sine) : std::atan2(sine, cosine) / sine;
  const double half = half_over_sine * sine;
  const double squared = 4.0 * half * half;
  const double c =
      squared > 1e-4 ? (1.0 - half_over_sine * cosine) / squared : 1.0 / 12.0 + squared / 720.0;
  const Eigen::Vector3d w = 2.0 * half_over_sine * v;
  const Eigen::Vector3d wp = w.cross(pose.translation);
  Vector6d d;
  d << w, pose.translation - 0.5 * wp + c * w.cross(wp);
  return d;
}

}  // namespace kinescope::structure_search
