// SPDX-License-Identifier: Apache-2.0
//
// Takes   the sightings of a film of any length.
// Gives   every k-th frame that shows a marker, so that a calibration's memory and time have a
//         bound. Neighbouring frames of so long a film say nearly the same.
#pragma once

#include <cstddef>
#include <optional>

#include "calib/camera/tag_observations.h"

namespace kinescope {

/// Corners of markers: 30000 squares, or 8 minutes of four at 15 frames a second.
inline constexpr std::size_t kMostCorners = 120000;

/// What every k-th frame shows, numbered anew.
struct ThinnedFrames {
  int every = 2;  ///< k, the least that leaves so many corners or fewer
  TagObservations tags;
};

/// Of the frames that show a marker and of those that show none, each k-th; frames keep their
/// times. Nothing where there are `most` corners or fewer.
[[nodiscard]] std::optional<ThinnedFrames> thin_frames(const TagObservations& tags,
                                                       std::size_t most = kMostCorners);

}  // namespace kinescope
