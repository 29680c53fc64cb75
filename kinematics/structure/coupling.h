// SPDX-License-Identifier: Apache-2.0
//
// Joints that several channels move (belts, tendons, counter-commanded joints).
#pragma once

#include <vector>

#include "kinematics/structure/chain.h"
#include "kinematics/structure/readings.h"

namespace kinescope::structure_search {

/// Adds to a driven single joint the channels that explain what is left along it, one at a time
/// while the gain is clear, and removes those that turn out to do nothing. Terms come out by size
/// of their motion. The fit has to hold its residuals.
[[nodiscard]] ChainFit with_couplings(ChainFit fit, const Motion& motion, const Readings& readings,
                                      const std::vector<char>& usable);

}  // namespace kinescope::structure_search
