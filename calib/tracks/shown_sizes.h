// SPDX-License-Identifier: Apache-2.0
//
// Takes   the poses of markers over time, as their declared sizes have them.
// Gives   the markers whose size is far from what was declared beside the others'.
// Method  a size scales a marker's positions. Two markers with one turning joint between them share
//         a point, R_i q_i + s_ij p_i = R_j q_j + p_j, that is linear in both arms and the ratio;
//         of two with a slide between them each is on a line as the other sees it. The pairs that
//         do so best, as a spanning tree, tell each size from the most common.
// Not here: a marker from which more than one joint leads to every other, and a marker at rest,
//         whose size its distance takes.
#pragma once

#include <vector>

#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

struct ShownSize {
  TagId id;
  double factor = 1.0;  ///< of the declared size
};

/// Of every marker that is off by more than a tenth, by id; smaller errors leave the robot that it
/// is. Of markers that agree on nothing (two, both in motion) the first is believed.
[[nodiscard]] std::vector<ShownSize> shown_sizes(const PoseTracks& tracks);

}  // namespace kinescope
