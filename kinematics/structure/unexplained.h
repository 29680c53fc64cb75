// SPDX-License-Identifier: Apache-2.0
//
// Takes   how a link hangs on its parent, fitted with the sightings' own noise.
// Gives   what its joint leaves of the motion that the link makes, as a share of that motion.
// Method  1 - R^2 in m^2 (rotations at kLever), the sightings' noise taken off. A share does not
//         depend on how well the markers are seen: errors of a joint (gear, wobble, another tag
//         size) are small beside its motion, and a joint of the wrong kind leaves much of it.
#pragma once

#include "kinematics/structure/attachment.h"

namespace kinescope::structure_search {

/// Shares of the squared motion of a link in its parent's frame; their sum is at most 1.
struct Unexplained {
  double across = 0.0;  ///< motion that the joint cannot make
  double along = 0.0;   ///< motion that it can make, but not with its channel's values

  [[nodiscard]] double all() const { return across + along; }
};

[[nodiscard]] Unexplained unexplained_motion(const Attachment& attachment);

}  // namespace kinescope::structure_search
