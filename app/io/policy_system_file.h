// SPDX-License-Identifier: Apache-2.0
//
// A system of the user's own for `kinescope policy`, as a YAML file:
//
//   name: pole on a cart             # default: the file's name
//   program: [python3, cart_pole.py] # run in the file's folder (program_system.h)
//   timeout: 10                      # s, for each of its lines
//   step: 0.05                       # s, over which an input is held
//   horizon: 3                       # s
//   trials: 5
//   sensing: full                    # or `positions`: speeds are estimated
//   speed_cutoff_hz: 8               # of that estimate; position_cutoff_hz, smoothing_cutoff_hz
//   positions:                       # in their order: angle, start (a list: several modes),
//     cart: {target: 0, length_scale: 1, tolerance: 0.1}        # start_sigma, noise, error, and
//     pole: {angle: true, target: 3.1416, length_scale: 3, ...} # the same below `speed`
//   inputs:
//     force: {limit: 10}
#pragma once

#include <filesystem>

#include "dynamics/policy/systems/problem.h"

namespace kinescope {

/// Throws bad_input, with file, line and remedy.
[[nodiscard]] policy::PolicyProblem read_policy_problem(const std::filesystem::path& path);

}  // namespace kinescope
