// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynamics/gp/robot_kernels.h"
#include "dynamics/rigid/rigid_model.h"

namespace kinescope::models {

/// What the kernels of dynamics/gp call a robot's joints.
[[nodiscard]] gp::JointKinds joint_kinds(const RigidModel& rigid);

}  // namespace kinescope::models
