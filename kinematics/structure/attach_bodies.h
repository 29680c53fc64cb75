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

}  // namespace kinescope::structure_search
