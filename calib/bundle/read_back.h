// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calib/bundle/solve.h"
#include "calib/bundle/uncertainty.h"

namespace kinescope::bundle {

/// Writes the solved state into the result: tree, camera, clock, joint values, estimates with
/// sigmas, parameter table, gauge.
void read_back(const Spec& spec, const State& state, const RobustSolution& robust,
               const Uncertainty& uncertainty, Calibration& out);

}  // namespace kinescope::bundle
