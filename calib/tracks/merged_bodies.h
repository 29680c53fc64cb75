// SPDX-License-Identifier: Apache-2.0
//
// Takes   pose tracks, and bodies of markers that keep their places among one another.
// Gives   tracks in which each body is one, that of its first marker, from all of its markers; and
//         the structure found of those with all markers on their links again.
// Why     a search that looks for chains of several joints looks at every track.
#pragma once

#include <vector>

#include "kinematics/structure/structure.h"

namespace kinescope {

struct MergedBody {
  std::vector<TagId> markers;  ///< by id
  std::vector<Pose> T_first_marker;
};

struct MergedBodies {
  PoseTracks tracks;
  std::vector<MergedBody> bodies;  ///< of two markers and more
};

/// Of rigid_bodies().
[[nodiscard]] MergedBodies merge_rigid_bodies(const PoseTracks& tracks);

/// Markers of a body go where its first one is.
void put_back(const std::vector<MergedBody>& bodies, Structure& structure);

}  // namespace kinescope
