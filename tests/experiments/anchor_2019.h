// SPDX-License-Identifier: Apache-2.0
//
// The structure tests of Dalla Libera et al. 2019 (arXiv 1903.04410), rebuilt as the figure to
// beat: linear tests of every pair of markers against every signal, weighted by the likelihood of a
// noise level that it is told, and the cheapest tree with one signal an edge. Knows no flips,
// scales, lags, couplings.
#pragma once

#include <vector>

#include "kinematics/log/joint_log.h"
#include "kinematics/model/kinematic_tree.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

struct AnchorEdge {
  TagId first;
  TagId second;
  JointType type = JointType::kRevolute;
  int channel = -1;
};

struct AnchorOptions {
  double sigma_rad = 0.01;
  double sigma_m = 0.001;
  bool serial = true;  ///< no marker has more than two neighbours
};

/// Uses the frames in which every marker was seen.
[[nodiscard]] std::vector<AnchorEdge> find_edges_2019(const PoseTracks& tracks, const JointLog& log,
                                                      const AnchorOptions& options);

}  // namespace kinescope
