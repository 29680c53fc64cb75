// SPDX-License-Identifier: Apache-2.0
//
// Takes   a joint log, and a tree grown without the copies in it.
// Gives   which columns tell one quantity twice (command and measured value, say), and which of
//         them the markers follow best; which of the columns that drive nothing repeat another.
// Method  one column regressed on the other at the delay that fits best (Gauss-Newton on the
//         delay).
#pragma once

#include <vector>

#include "kinematics/log/joint_log.h"
#include "kinematics/structure/search.h"
#include "kinematics/structure/structure.h"

namespace kinescope::structure_search {

/// Columns of a log that tell the same quantity in the same unit, but for noise, a constant and a
/// short delay; by index, at least two.
using SameQuantity = std::vector<int>;

/// O(channels^2 * samples), but for pairs of unlike spread.
[[nodiscard]] std::vector<SameQuantity> same_quantities(const JointLog& log);

/// The log with these channels only.
[[nodiscard]] JointLog with_channels(const JointLog& log, const std::vector<int>& channels);

/// Of each group one channel, with all that are in no group; in the log's order.
[[nodiscard]] std::vector<int> channels_with(const JointLog& log,
                                             const std::vector<SameQuantity>& groups,
                                             const std::vector<int>& chosen);

/// Of each group the channel that the tree's markers follow best; the one it was grown with unless
/// another is clearly better. `found` was grown on `series` and with_channels(channels_with(log,
/// groups, chosen)).
[[nodiscard]] std::vector<int> best_copies(const FoundTree& found, const Series& series,
                                           const JointLog& log,
                                           const std::vector<SameQuantity>& groups,
                                           std::vector<int> chosen,
                                           const StructureOptions& options);

/// Of channels that drive nothing those that tell less exactly what a driving one tells: a command
/// that a drive follows with a delay, a dead band, a droop under load. Each with the one it is most
/// like. O(idle * driving * samples).
[[nodiscard]] std::vector<ChannelCopy> repeated_loosely(const JointLog& log,
                                                        const std::vector<int>& idle,
                                                        const std::vector<int>& driving);

}  // namespace kinescope::structure_search
