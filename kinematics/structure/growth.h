// SPDX-License-Identifier: Apache-2.0
//
// Takes   a Series and Readings.
// Gives   GrownTree: links with known paths, every body on one of them or free, and for every body
// the
//         alternatives that were looked at.
// Method  from the camera outward: the body that hangs on a known link best is attached next; its
// link's path
//         then follows from the channels alone, so that noise does not pile up along the chain.
//         Afterwards every body may change its place while that helps, and channels are given out
//         once each.
#pragma once

#include <vector>

#include "kinematics/structure/attachment.h"

namespace kinescope::structure_search {

struct GrownLink {
  int parent = -1;        ///< link; -1 for the camera's
  int founder = -1;       ///< body whose marker frame is the link's frame; -1 for the camera's
  Attachment attachment;  ///< of the founder on the parent
  LinkPath path;
};

struct GrownBody {
  int link = -1;                         ///< -1: free
  Attachment attachment;                 ///< on `link` at rest, or the founder's
  std::vector<Attachment> alternatives;  ///< all looked at (against all links), without paths
  double free_cost = 0.0;                ///< of moving freely, along whatever directions were seen
  double everywhere_cost = 0.0;          ///< of moving freely, as far in every direction
  int rests_on = -1;                     ///< link on which it plainly rests; -1: on none
};

struct GrownTree {
  std::vector<GrownLink> links;   ///< parents before children
  std::vector<GrownBody> bodies;  ///< as in the series
};

struct GrowthOptions {
  double accept_variance = 16.0;  ///< of the residual across a joint, over the declared one; or
  double accept_ratio = 40.0;     ///< the motion over what is left of it, beyond the noise
  double free_ratio = 25.0;       ///< the same that a joint without a channel needs at least
  bool paths_of_several_joints = true;
};

[[nodiscard]] GrownTree grow_tree(const Series& series, const Readings& readings,
                                  const GrowthOptions& options = {});

/// The same tree with all models refitted to other readings (another time offset).
[[nodiscard]] GrownTree refit_tree(const GrownTree& tree, const Series& series,
                                   const Readings& readings);

/// Sum of the bodies' data costs.
[[nodiscard]] double tree_cost(const GrownTree& tree);

}  // namespace kinescope::structure_search
