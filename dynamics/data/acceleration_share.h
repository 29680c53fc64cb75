// SPDX-License-Identifier: Apache-2.0
//
// How much of a joint's torque goes with its acceleration: what an error of the acceleration costs.
#pragma once

#include <Eigen/Core>

#include "dynamics/data/torque_log.h"

namespace kinescope {

/// For each joint, the part (0 to 1) of the torque's variance that its acceleration explains beside
/// offset, friction and gravity (sines and cosines of all positions), in a rough fit at a low
/// cut-off of a twentieth of the sampling rate, 5 Hz at most. Ones where there is no torque; 0 of a
/// joint that does not move.
[[nodiscard]] Eigen::VectorXd acceleration_shares(const TorqueLog& log, double step_s);

}  // namespace kinescope
