// SPDX-License-Identifier: Apache-2.0
//
// Takes   the sightings of a recording.
// Gives   them without those of frames that show the image before once more: a recorder that lacked
//         a frame, or a file made from another of a lower rate. Their stamps say that the robot had
//         moved on.
#pragma once

#include <string>
#include <vector>

#include "calib/camera/tag_observations.h"

namespace kinescope {

/// Frames in which every corner is where it was to the last digit, while the markers move by more
/// than their noise before and after. Their sightings become rejected ones.
void leave_out_repeated_frames(TagObservations& tags);

/// One sentence about those; none where there is none.
[[nodiscard]] std::vector<std::string> repeated_frame_words(const TagObservations& tags);

}  // namespace kinescope
