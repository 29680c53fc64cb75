// SPDX-License-Identifier: Apache-2.0
//
// Takes   logs with torques, and a robot as a URDF.
// Gives   models of the torque side by side, masses, friction, what they lack: `kinescope dynamics`
//         without its words.
#pragma once

#include "app/report/torque_summary.h"
#include "app/torque/torque_options.h"
#include "kinematics/core/progress.h"

namespace kinescope {

/// Writes dynamics.json, robot_dynamics.urdf and dynamics.html.
[[nodiscard]] TorqueSummary model_torque(const DynamicsOptions& options, const Progress& progress);

}  // namespace kinescope
