// SPDX-License-Identifier: Apache-2.0
//
// A growing tree with what it grows on, and which of the known attachments of a body is to be
// believed.
#pragma once

#include <vector>

#include "kinematics/structure/growth.h"

namespace kinescope::structure_search {

struct GrowthState {
  const Series& series;
  const Readings& readings;
  GrowthOptions options;
  std::vector<char> usable;         ///< channels that move
  std::vector<double> likely_cost;  ///< of a body on its neighbours, a sighting; infinite: unknown
  std::vector<char> moves_freely;   ///< bodies whose joint without a channel was given up
  GrownTree tree;
};

/// The camera alone, with every body's ways to hang on it.
[[nodiscard]] GrowthState start_growth(const Series& series, const Readings& readings,
                                       const GrowthOptions& options,
                                       const std::vector<double>& likely_cost);

/// A tree that has grown, to be changed.
[[nodiscard]] GrowthState continued_growth(GrownTree tree, const Series& series,
                                           const Readings& readings, const GrowthOptions& options);

/// Appends a link and lists the ways in which the bodies may hang on it.
void add_link(GrowthState& state, GrownLink link);

/// Adds the ways in which a body may hang on a link to its alternatives.
void list_alternatives(GrowthState& state, std::size_t body, int link);

/// The same for every body and every link.
void list_all_alternatives(GrowthState& state);

/// Lists those of the free bodies anew, whatever their likely cost; false when there are none.
bool look_again_at_free_bodies(GrowthState& state);

/// Good enough to be believed: clean, and better than moving freely.
[[nodiscard]] bool is_acceptable(const GrowthState& state, std::size_t body, const Attachment& a);

/// The best of what is known of a body, if it is acceptable; else null. Of a joint that would need
/// to leave less to do without a channel, the same joint with one, or rest, may be.
[[nodiscard]] const Attachment* acceptable_best(const GrowthState& state, std::size_t body);

}  // namespace kinescope::structure_search
