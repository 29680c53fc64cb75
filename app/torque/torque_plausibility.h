// SPDX-License-Identifier: Apache-2.0
//
// Are these the torques of this motion? Asked after the identification, before anything is written.
#pragma once

#include "app/report/torque_summary.h"
#include "dynamics/data/torque_log.h"
#include "dynamics/data/torque_scale.h"
#include "dynamics/models/torque_model.h"

namespace kinescope {

/// Throws bad_input where two torque columns stand in each other's place, with the list that puts
/// them right; undetermined where the rigid bodies and drives explain no joint's torque better than
/// a constant does, and the robot's own masses (`scales`: against them, where there are any) do not
/// either. `parametric`: of summary.identification.
void require_torques_of_motion(const DynamicModel& model, const TorqueSummary& summary,
                               const TorqueLog& log, const TorqueScales& scales,
                               const FittedTorqueModel& parametric,
                               const TorqueModelOptions& options);

}  // namespace kinescope
