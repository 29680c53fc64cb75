// SPDX-License-Identifier: Apache-2.0
//
// The path of a link from its parent's: from the channels alone where they tell all, so that the
// noise of sightings does not pile up along the chain.
#pragma once

#include "kinematics/structure/attachment.h"

namespace kinescope::structure_search {

/// Residuals of more than this many times the variance declared are more than noise; along the
/// joint its channel is inexact then (backlash, gear error).
inline constexpr double kInexact = 1.5;

/// The path of the body that hangs on `parent` by this attachment.
[[nodiscard]] LinkPath path_of(const Attachment& attachment, const Body& body,
                               const LinkPath& parent, const Readings& readings);

}  // namespace kinescope::structure_search
