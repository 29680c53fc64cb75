// SPDX-License-Identifier: Apache-2.0
//
// The torques of a plant's drives at one sample: what moves the plant (simulation.h) and what a
// controller compensates.
#pragma once

#include "dynamics/simulation/plant.h"

namespace kinescope {

/// What a drive adds beside inertia, viscous and dry friction, N m or N.
[[nodiscard]] double smooth_torque(const JointDrive& drive, double q, double dq, double t_s);

/// What the direction of the speed is multiplied by. `load`: torque of the bodies at the joint.
[[nodiscard]] double dry_amplitude(const JointDrive& drive, double q, double dq, double t_s,
                                   double load);

}  // namespace kinescope
