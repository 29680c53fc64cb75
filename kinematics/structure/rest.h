// SPDX-License-Identifier: Apache-2.0
//
// Bodies at rest against each other, judged by how far they move rather than by statistics alone.
#pragma once

#include <optional>

#include "kinematics/structure/attachment.h"

namespace kinescope::structure_search {

/// The body at rest on a link, where what is left of it is so small that no robot moves by it:
/// corners that err alike from frame to frame (compression, one light) pass for a slow motion in
/// the statistics, but not in millimetres.
[[nodiscard]] std::optional<Attachment> practical_rest(const Body& body, int link,
                                                       const LinkPath& path,
                                                       const Readings& readings);

/// Whether that may be so, from some of the samples.
[[nodiscard]] bool may_rest(const Motion& motion, const Body& body);

/// Whether two bodies keep one relative pose wherever both are seen, for all that `a` moves by
/// `motion_size` (m).
[[nodiscard]] bool rest_on_each_other(const Body& a, double motion_size, const Body& b,
                                      const Readings& readings);

/// Whether a body keeps its pose in a link's frame: to the noise, or for all that a robot moves by.
[[nodiscard]] bool keeps_pose(const Body& body, const LinkPath& path, const Readings& readings);

/// The same of two bodies, in each other's frame.
[[nodiscard]] bool keep_relative_pose(const Body& a, const Body& b, const Readings& readings);

}  // namespace kinescope::structure_search
