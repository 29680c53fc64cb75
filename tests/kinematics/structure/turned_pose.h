// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kinematics/core/pose.h"

namespace kinescope {

inline constexpr double kExactProduct = 1e-12;  // of a few poses

inline Pose turned_pose(double turn, const Eigen::Vector3d& at) {
  return {exp_rotation(Eigen::Vector3d(0.3, -0.2, 1.0).normalized() * turn), at};
}

}  // namespace kinescope
