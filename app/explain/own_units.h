// SPDX-License-Identifier: Apache-2.0
//
// Takes   a nominal robot with its columns, what the markers show by themselves, and the log.
// Gives   the robot with scale, direction and zero of columns that count in units of their own.
// Method  scales from the structure; directions and zeros by laying its axes on the drawing's.
#pragma once

#include "app/explain/nominal_channels.h"

namespace kinescope {

/// The robot where columns count in units of their own (declared as ticks, or by what the markers
/// show in none that people log): what one of them is, which way and from where, by the axes of the
/// drawing; what these do not tell is said, and taken as drawn, from the middle of what was seen.
/// Throws undetermined where the markers do not show the joints by themselves.
[[nodiscard]] NominalChannels with_own_units(NominalChannels matched, const Structure& structure,
                                             const Recording& recording);

}  // namespace kinescope
