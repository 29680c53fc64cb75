// SPDX-License-Identifier: Apache-2.0
//
// What is known of a log before it is looked at: a channel that moves mostly drives a joint, and
// each joint has its own.
#pragma once

#include "kinematics/structure/grown_tree.h"

namespace kinescope::structure_search {

/// For every channel whether it moves and is no joint's main one. Couplings do not count: a channel
/// that couples has a joint of its own.
[[nodiscard]] std::vector<char> idle_channels(const GrownTree& tree, const Readings& readings);

/// -2 ln prior of the channels that are idle, beside the penalties of those that are not, up to a
/// constant: each of them could have driven a joint, and joints choose among those that are left.
[[nodiscard]] double idle_cost(int idle, const Readings& readings);

/// The same for a tree.
[[nodiscard]] double idle_cost(const GrownTree& tree, const Readings& readings);

/// What it would change by if the body hung by another attachment.
[[nodiscard]] double idle_change(const GrownTree& tree, const Readings& readings, std::size_t body,
                                 const Attachment& attachment);

}  // namespace kinescope::structure_search
