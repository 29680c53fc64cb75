// SPDX-License-Identifier: Apache-2.0
//
// Takes   a body, and a link whose path is known.
// Gives   the ways in which the body may hang on the link (rest, turn, slide; by which channels).
// Method  linear screening, then a fit of the whole chain to the promising candidates.
#pragma once

#include <limits>
#include <vector>

#include "kinematics/structure/attachment.h"

namespace kinescope::structure_search {

struct AttachmentOptions {
  bool coordinate_free = true;  ///< joints that no channel drives
  /// Cost per sighting beyond which nothing is refined.
  double give_up_above = std::numeric_limits<double>::infinity();
  int max_refined = 4;
};

/// All looked at, best first (with the correlation of the best).
[[nodiscard]] std::vector<Attachment> find_attachments(const Body& body, int parent,
                                                       const LinkPath& path,
                                                       const Readings& readings,
                                                       const std::vector<char>& usable,
                                                       const AttachmentOptions& options = {});

/// Refits a model on (other) sightings.
[[nodiscard]] Attachment refit(const Attachment& attachment, const Body& body, const LinkPath& path,
                               const Readings& readings);

}  // namespace kinescope::structure_search
