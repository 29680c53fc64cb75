// SPDX-License-Identifier: Apache-2.0
//
// Takes   a structure that left a marker free, and a link that might carry it.
// Gives   the structure with the marker on that link.
#pragma once

#include "kinematics/structure/structure.h"

namespace kinescope {

/// `T_link_marker` in the frame of that link of `structure_tree`, for link 0 in the camera's.
/// Doubts about the marker are gone; the status is kept.
[[nodiscard]] Structure with_marker_on(Structure structure, TagId marker, int link,
                                       const Pose& T_link_marker);

/// Of a link whose first marker is another one now: what was given from the old one is given from
/// it. The camera's link stays as it is.
void take_first_reference(Structure& structure, int link);

}  // namespace kinescope
