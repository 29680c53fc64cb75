// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grown tree on which every body has found a place, one after the other.
// Gives   the best tree in reach: bodies at better places, channels given out once each.
// Method  single moves while they help. Two errors are beyond them, since all that hangs further
//         out is out of place, too: markers that share a link while the channel of the joint
//         between them drives nothing; and two joints in series taken for one (coupled, or of
//         an odd scale), with the marker between them hung on the far side. There the link is taken
//         apart and the tree grown again from it; the better of the two trees is kept.
#pragma once

#include "kinematics/structure/growth_state.h"

namespace kinescope::structure_search {

/// Moves single bodies to better places and deals out the channels until nothing changes.
void rearrange(GrowthState& state);

/// Takes links apart while that helps; what was no better is listed in the tree's rivals. False
/// when nothing helped.
bool take_links_apart(GrowthState& state);

}  // namespace kinescope::structure_search
