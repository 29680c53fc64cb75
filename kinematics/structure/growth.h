// SPDX-License-Identifier: Apache-2.0
//
// Takes   a Series and Readings.
// Gives   GrownTree: links with known paths, every body on one of them or free, and for every body
//         the alternatives that were looked at.
// Method  from the camera outward: the body that hangs on a known link best is attached next; its
//         link's path then follows from the channels alone, so that noise does not pile up along
//         the chain. Afterwards every body may change its place while that helps, and channels are
//         given out once each (rearrange.h).
#pragma once

#include <vector>

#include "kinematics/structure/grown_tree.h"

namespace kinescope::structure_search {

struct GrowthOptions {
  double accept_variance = 16.0;  ///< of the residual across a joint, over the declared one; or
  double accept_ratio = 40.0;     ///< the motion over what is left of it, beyond the noise
  double free_ratio = 25.0;       ///< the same that a joint without a channel needs at least
  bool paths_of_several_joints = true;
};

/// `likely_cost`: of every body on its neighbours, a sighting (likely_costs()); far worse places
/// are not fitted at first. Empty: nothing is known.
[[nodiscard]] GrownTree grow_tree(const Series& series, const Readings& readings,
                                  const GrowthOptions& options = {},
                                  const std::vector<double>& likely_cost = {});

}  // namespace kinescope::structure_search
