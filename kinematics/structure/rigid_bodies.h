// SPDX-License-Identifier: Apache-2.0
//
// Takes   PoseTracks of a camera that may move.
// Gives   which markers keep their places among one another, and whether any stands still.
// Method  the relative pose of two markers, or a marker's own, is constant to the noise that the
//         tracks show from frame to frame, or moves by less than a robot does.
#pragma once

#include <vector>

#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// The largest first, of equal ones that of the smallest id; ids increase. Markers that are seen in
/// fewer than 8 frames are left out. Cost O(markers^2 * frames).
[[nodiscard]] std::vector<std::vector<TagId>> rigid_bodies(const PoseTracks& tracks);

/// In the camera's frame.
[[nodiscard]] bool is_any_at_rest(const PoseTracks& tracks);

}  // namespace kinescope
