// SPDX-License-Identifier: Apache-2.0
//
// Takes   the sightings of a film of any length.
// Gives   those of every k-th frame that shows a marker, so that a calibration's memory and time
//         have a bound. Neighbouring frames of so long a film say nearly the same.
#pragma once

#include <cstddef>

#include "calib/camera/tag_observations.h"

namespace kinescope {

/// Corners of markers: 30000 squares, or 8 minutes of four at 15 frames a second.
inline constexpr std::size_t kMostCorners = 120000;

/// Keeps the sightings of every k-th of the frames that have some, k the least that leaves `most`
/// corners or fewer; frame numbers and times stay. Gives k; 1: nothing was left out.
int thin_frames(TagObservations& tags, std::size_t most = kMostCorners);

}  // namespace kinescope
