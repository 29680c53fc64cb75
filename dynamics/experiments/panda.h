// SPDX-License-Identifier: Apache-2.0
//
// The worlds of the LIP paper (Giacomuzzo, Carli, Romeres, Dalla Libera 2024, section VI-A): pairs
// of trajectories of a simulated Panda, 500 samples each.
#pragma once

#include <cstdint>

#include "dynamics/experiments/comparison_runs.h"

namespace kinescope::experiments {

/// White, on every torque, N m; also on those that are judged on, as in the paper.
inline constexpr double kPandaNoise_nm = 0.01;

/// The Panda's first `joints` joints, the rest of it held in its frame's zero posture and moved as
/// one body. The same trajectories whatever their number.
[[nodiscard]] ComparisonCase panda_case(int joints, int run, std::uint64_t seed);

}  // namespace kinescope::experiments
