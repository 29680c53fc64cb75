// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grown tree.
// Gives   the same with slides in place of turns (and turns in place of slides) where the channel
//         then is in m (or rad) and was in no unit that a log would have.
// Method  a short slide that is bent, whose marker slips or whose lens is not as declared looks
//         like a turn about a far axis; by the noise alone it is one beyond doubt. But a channel
//         that tells a slide's metres to a few per cent does not do so by accident.
#pragma once

#include <vector>

#include "kinematics/structure/grown_tree.h"

namespace kinescope::structure_search {

[[nodiscard]] GrownTree in_natural_units(GrownTree tree, const Series& series,
                                         const Readings& readings);

/// Whether one channel drives both single joints (fingers of a gripper, a link kept level): both
/// leave nothing but noise, and its unit is a usual one for both, or the same for both. A marker of
/// another size, one that slips or a bent lens looks like a second joint too, but in an odd unit.
[[nodiscard]] bool share_a_channel(const Attachment& a, const Attachment& b,
                                   const Readings& readings);

/// Two single joints whose channels are multiples of each other, so that the motion cannot tell
/// which drives which: the same tree with the channels exchanged.
struct Exchange {
  int first_link = 0;
  int second_link = 0;
  double loss = 0.0;      ///< -2 ln prior of the exchanged scales over that of the present ones
  bool declared = false;  ///< the units of both, so that the loss is no matter of custom
};
[[nodiscard]] std::vector<Exchange> possible_exchanges(const GrownTree& tree,
                                                       const Readings& readings);

/// Exchanges channels of which only the scales can tell, where usual units speak for it.
[[nodiscard]] GrownTree with_likely_exchanges(GrownTree tree, const Readings& readings);

}  // namespace kinescope::structure_search
