// SPDX-License-Identifier: Apache-2.0
//
// Joints that carry one load each say how heavy it is. Internal to this room.
#pragma once

#include "calib/trace/trace_result.h"
#include "dynamics/effects/traced_torque.h"

namespace kinescope::effects {

/// Where joints disagree about a payload by more than their noise (the gains of their drives are
/// not what they are said to be), its interval grows: the gain that all have in common is no better
/// known than the joints agree. Random effects, DerSimonian and Laird 1986.
void widen_by_disagreement(const TorqueTracedModel& model, Trace& trace);

}  // namespace kinescope::effects
