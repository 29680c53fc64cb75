// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kinematics/core/pose.h"
#include "kinematics/core/rng.h"

namespace kinescope {

/// Normal tangents: rotation of `rad`, translation of `m` (standard deviation of a coordinate).
inline Pose random_pose(Rng& rng, double rad, double m) {
  Vector6d d;
  d << rng.normal3(rad), rng.normal3(m);
  return exp_pose(d);
}

}  // namespace kinescope
