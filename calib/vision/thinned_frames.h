// SPDX-License-Identifier: Apache-2.0
//
// Takes   the sightings of a film of any length.
// Gives   every k-th frame that shows a marker, so that a calibration's memory and time have a
//         bound. Neighbouring frames of so long a film say nearly the same.
#pragma once

#include <cstddef>

#include "calib/camera/tag_observations.h"

namespace kinescope {

/// Corners of markers: 30000 squares, or 8 minutes of four at 15 frames a second.
inline constexpr std::size_t kMostCorners = 120000;

[[nodiscard]] std::size_t corners_of(const TagObservations& tags);

/// The least k for which one frame in k leaves `most` corners or fewer; 1: all frames stay.
[[nodiscard]] int thinning_of(std::size_t corners, std::size_t most = kMostCorners);

/// Of the frames that show a marker and of those that show none, each k-th, numbered anew; they
/// keep their times.
[[nodiscard]] TagObservations every_kth_frame(const TagObservations& tags, int k);

}  // namespace kinescope
