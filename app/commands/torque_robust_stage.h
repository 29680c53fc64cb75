// SPDX-License-Identifier: Apache-2.0
//
// The robust regressions of a torque log and what the robot carries.
#pragma once

#include "app/commands/commands.h"
#include "app/report/torque_summary.h"

namespace kinescope {

/// Three regressions beside each other, judged on the summary's test samples; the best of the
/// robust ones in friction, gravity and inertia parts. What cannot be done is a warning.
void add_robust_regressions(const DynamicModel& model, const TorqueModelOptions& options,
                            TorqueSummary& summary);

/// From all of the log: by all of the motion, and at rest. Throws what estimate_payload() throws.
void add_payload(const DynamicsOptions& options, const DynamicModel& model, TorqueSummary& summary);

}  // namespace kinescope
