// SPDX-License-Identifier: Apache-2.0
//
// The problems of the literature by name.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dynamics/policy/systems/problem.h"

namespace kinescope::policy {

/// "cartpole", "furuta", "ball_plate", "pendubot", "acrobot".
[[nodiscard]] std::vector<std::string> problem_names();

/// Its system with sensors for all states, or for positions alone. `plain`: although only positions
/// are measured, particles are seen as they are and the model learns from what the policy saw, as
/// in MC-PILCO before it knew of sensors; for comparison. Throws bad_request for a name that is
/// none.
[[nodiscard]] PolicyProblem problem_named(std::string_view name, Sensing sensing,
                                          bool plain = false);

}  // namespace kinescope::policy
