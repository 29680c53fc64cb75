// SPDX-License-Identifier: Apache-2.0
//
// The channel that goes with a joint's free coordinate.
#pragma once

#include <optional>
#include <vector>

#include "kinematics/structure/readings.h"
#include "kinematics/structure/screening.h"

namespace kinescope::structure_search {

/// A joint with free coordinates as its best channel would drive it, or two together where none
/// does alone; nothing when none go with them. Angles between few and fast samples may have been
/// counted a turn off.
[[nodiscard]] std::optional<Candidate> driven_by_best_channel(const ChainModel& free,
                                                              const Motion& motion,
                                                              const Readings& readings,
                                                              const std::vector<char>& usable);

}  // namespace kinescope::structure_search
