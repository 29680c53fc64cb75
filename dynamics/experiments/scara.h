// SPDX-License-Identifier: Apache-2.0
//
// The worlds of Dalla Libera's SCARA experiments: one trajectory to learn from, another one to be
// judged on, both sums of 200 random sinusoids.
#pragma once

#include <cstdint>

#include "dynamics/experiments/comparison_runs.h"

namespace kinescope::experiments {

/// How far an arm is from its data sheet: normal amounts about, and along, each axis of each joint.
struct Misplacement {
  double tilt_rad = 0.0;
  double shift_m = 0.0;
};

struct ScaraOptions {
  int samples = 2000;       ///< to learn from
  int test_samples = 2000;  ///< without noise
  double noise = 0.01;      ///< share of the spread of each joint's torque
  std::uint64_t seed = 1;
};

/// The arm is misplaced and the data sheet is believed. The other way round, a sheet's base
/// parameters absorb nearly all of it: an arm whose axes are parallel moves as one of other masses,
/// while gravity about an axis that leans has no term in the sheet of a vertical one. Runs of one
/// number have the same motion, and misplacements in the same directions, at every size.
[[nodiscard]] ComparisonCase scara_case(const Misplacement& size, int run,
                                        const ScaraOptions& options);

/// The same with the first `samples` of it to learn from.
[[nodiscard]] ComparisonCase first_of(ComparisonCase all, int samples);

}  // namespace kinescope::experiments
