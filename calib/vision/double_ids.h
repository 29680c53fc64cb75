// SPDX-License-Identifier: Apache-2.0
//
// Takes   all sightings of a recording, also several of one id in a frame.
// Gives   the ids that two markers carry; what is no robot's marker of these is put aside.
// Method  sightings of an id are linked to tracklets by place and motion; two tracklets that are
//         seen at the same time are of two markers, which colours the tracklets of the id.
// Not here: single detections that are wrong (sightings.h).
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "calib/camera/tag_observations.h"

namespace kinescope {

/// Which of two markers with one id is taken.
enum class TakenMarker { kMoving, kNone };

/// Where one of the two moves in the image and the other does not, the sightings of the one at rest
/// go to `rejected`, otherwise those of both. What is seen together in fewer than `min_sightings`
/// frames stays as it is. `observations` are sorted by frame.
[[nodiscard]] std::map<TagId, TakenMarker> put_second_markers_aside(TagObservations& observations,
                                                                    int min_sightings);

/// How the warning begins.
inline constexpr std::string_view kTwoMarkers = "two markers with id";

/// "two markers with id 5 are in view: remove one (..)".
[[nodiscard]] std::string two_markers_warning(TagId id, TakenMarker taken);

}  // namespace kinescope
