// SPDX-License-Identifier: Apache-2.0
//
// Moves that rearrange a grown tree: bodies that change their place, and joints that are given up.
#pragma once

#include "kinematics/structure/growth_state.h"

namespace kinescope::structure_search {

/// The attachment's main channel already drives another joint, which has no other to take instead.
[[nodiscard]] bool conflicts(const GrownTree& tree, std::size_t body, const Attachment& a);

/// price_of_further_channel() of a joint in conflict, else 0.
[[nodiscard]] double price_of_sharing(const GrowthState& state, std::size_t body,
                                      const Attachment& a);

/// Hangs an attached body elsewhere, with everything on it; what this unsettles is looked at anew.
void move_body(GrowthState& state, std::size_t body, Attachment attachment);

/// Sets a link with everything on it free; gives the new number of its parent.
int release_link(GrowthState& state, int link);

/// The same for all that hangs on a link by joints, and for one of the bodies at rest on it.
void release_children(GrowthState& state, int link, std::size_t body);

/// Moves the body to the best place known, by a joint without a channel only where that is to be
/// believed; false when it stands there already.
bool improve(GrowthState& state, std::size_t body);

/// A joint that no channel drives stands on one marker's word: that its motion has one direction.
/// Where another marker of the same rigid body moves by no joint, the body only happened to keep to
/// a line while the first one was seen, and is free. True when such a joint was taken out.
bool give_up_contradicted_joint(GrowthState& state);

}  // namespace kinescope::structure_search
