// SPDX-License-Identifier: Apache-2.0
//
// Takes   a body, a known link, and the channels that drive nothing yet.
// Gives   a chain of several joints between the two, with no marker on the links between.
// Method  which channels matter, and the twist of each, from a regression near one posture, where
// the order
//         of the joints does not show; then the order, the types and couplings by refitting the
//         whole chain. Orders that fit alike are put in the order of the log, and listed as doubts.
#pragma once

#include <optional>
#include <vector>

#include "kinematics/structure/attachment.h"

namespace kinescope::structure_search {

/// How simply a body seems to hang on a link: channels that matter near one posture, and what a
/// linear model of them leaves there. Cheap; 0 channels: no case for several joints.
struct SerialOutlook {
  int channels = 0;
  double residual = 0.0;
};
[[nodiscard]] SerialOutlook serial_outlook(const Body& body, const LinkPath& path,
                                           const Readings& readings,
                                           const std::vector<char>& unused);

/// Nothing when fewer than two channels matter or there are too few sightings.
[[nodiscard]] std::optional<Attachment> find_serial_attachment(const Body& body, int parent,
                                                               const LinkPath& path,
                                                               const Readings& readings,
                                                               const std::vector<char>& unused);

}  // namespace kinescope::structure_search
