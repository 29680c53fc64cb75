// SPDX-License-Identifier: Apache-2.0
//
// Every channel is the main one of one joint, but for those that plainly drive several.
#pragma once

#include "kinematics/structure/growth_state.h"

namespace kinescope::structure_search {

/// Coupled joints take another channel of theirs where that helps; of two joints that still share
/// one, the one that loses least takes its next best explanation, unless both plainly have it
/// (share_a_channel). True when any joint was replaced.
bool assign_channels(GrowthState& state);

}  // namespace kinescope::structure_search
