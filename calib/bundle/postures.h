// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "kinematics/log/joint_log.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// is_posture_log() of the channels that drive a joint of the tree, by themselves or by a coupling;
/// false without a log.
[[nodiscard]] bool shows_postures(const KinematicTree& tree, const JointLog& log,
                                  const std::vector<double>& times_s);

}  // namespace kinescope
