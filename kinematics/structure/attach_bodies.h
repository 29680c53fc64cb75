// SPDX-License-Identifier: Apache-2.0
//
// Moves that hang free bodies on a growing tree.
#pragma once

#include "kinematics/structure/growth_state.h"

namespace kinescope::structure_search {

/// Hangs a body where the attachment says: at rest on a link, or as the founder of a new one.
void place(GrowthState& state, std::size_t body, Attachment attachment);

/// Attaches the body that fits best anywhere, again and again until none is acceptable.
void attach_all(GrowthState& state);

/// Attaches one body by several joints in series with no marker between; false when none is
/// acceptable.
bool attach_through_unseen_links(GrowthState& state);

/// A single joint that leaves far more than noise, while several channels move it or a channel
/// drives nothing, may be several joints in series with no marker between. True when one was
/// replaced.
bool unfold_coarse_joint(GrowthState& state);

/// Such a joint; `channel_left`: a channel that moves drives nothing.
[[nodiscard]] bool is_coarse(const Attachment& attachment, bool channel_left);

}  // namespace kinescope::structure_search
