// SPDX-License-Identifier: Apache-2.0
//
// Takes   a structure with a joint that turns by little about a far axis.
// Gives   the structure with a slide along the arc's tangent in its place: a lens that bends the
//         image makes the one look like the other.
#pragma once

#include <cstddef>
#include <optional>

#include "kinematics/log/joint_log.h"
#include "kinematics/structure/structure.h"

namespace kinescope {

/// In place of a joint of the structure that one channel of the log turns. The slide runs through
/// the child's reference marker where the channel reads its median, with the speed that the marker
/// has there. Nothing where the joint slides, turns by more than a few degrees, is driven by no
/// channel or by several, or has its axis in the marker.
[[nodiscard]] std::optional<Structure> with_slide_for_slight_turn(const Structure& structure,
                                                                  std::size_t joint,
                                                                  const JointLog& log);

}  // namespace kinescope
