// SPDX-License-Identifier: Apache-2.0
//
// The path of a link from its parent's: from the channels alone where they tell all, so that the
// noise of sightings does not pile up along the chain.
#pragma once

#include "kinematics/structure/attachment.h"

namespace kinescope::structure_search {

/// A channel is inexact (backlash, gear error) when the residual along the joint has this many
/// times the variance declared.
inline constexpr double kInexact = 1.5;

/// The path of the body that hangs on `parent` by this attachment.
[[nodiscard]] LinkPath path_of(const Attachment& attachment, const Body& body,
                               const LinkPath& parent, const Readings& readings);

}  // namespace kinescope::structure_search
