// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/growth.h"

#include "kinematics/structure/assign_channels.h"
#include "kinematics/structure/attach_bodies.h"
#include "kinematics/structure/growth_state.h"
#include "kinematics/structure/move_bodies.h"

namespace kinescope::structure_search {
namespace {

// Moves single bodies to better places, then deals out the channels; true when anything changed.
bool rearrange(GrowthState& state) {
  bool changed = false;
  for (std::size_t b = 0; b < state.tree.bodies.size(); ++b) changed = improve(state, b) || changed;
  return assign_channels(state) || changed;
}

}  // namespace

GrownTree grow_tree(const Series& series, const Readings& readings, const GrowthOptions& options,
                    const std::vector<double>& likely_cost) {
  constexpr int kMostRounds = 4;  // in which bodies may change places
  GrowthState state = start_growth(series, readings, options, likely_cost);
  do {
    attach_all(state);
    if (look_again_at_free_bodies(state)) attach_all(state);
  } while (options.paths_of_several_joints && attach_through_unseen_links(state));
  for (int round = 0; round < kMostRounds && rearrange(state); ++round) {
  }
  while (give_up_contradicted_joint(state)) {
  }
  return std::move(state.tree);
}

}  // namespace kinescope::structure_search
