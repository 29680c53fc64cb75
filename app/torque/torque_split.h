// SPDX-License-Identifier: Apache-2.0
//
// Which samples of a torque log are learned from and which are judged on.
#pragma once

#include "app/report/torque_summary.h"
#include "app/torque/torque_options.h"

namespace kinescope {

/// Fills train, test, split, split_at_random and new_motion of a summary that has its data. Throws
/// what reading the logs of --test throws; undetermined for too few samples.
void split_samples(const DynamicsOptions& options, const DynamicModel& model,
                   TorqueSummary& summary);

}  // namespace kinescope
