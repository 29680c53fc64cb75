// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/growth.h"

#include "kinematics/structure/attach_bodies.h"
#include "kinematics/structure/growth_state.h"
#include "kinematics/structure/move_bodies.h"
#include "kinematics/structure/rearrange.h"

namespace kinescope::structure_search {
GrownTree grow_tree(const Series& series, const Readings& readings, const GrowthOptions& options,
                    const std::vector<double>& likely_cost) {
  GrowthState state = start_growth(series, readings, options, likely_cost);
  do {
    attach_all(state);
    if (look_again_at_free_bodies(state)) attach_all(state);
  } while (options.paths_of_several_joints && attach_through_unseen_links(state));
  rearrange(state);
  const int joints = options.paths_of_several_joints ? readings.channels() : 0;
  for (int k = 0; k < joints && unfold_coarse_joint(state); ++k) rearrange(state);
  while (give_up_contradicted_joint(state)) {
  }
  return std::move(state.tree);
}

}  // namespace kinescope::structure_search
