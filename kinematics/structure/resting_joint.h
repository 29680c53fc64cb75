// SPDX-License-Identifier: Apache-2.0
//
// Takes   a structure with a joint that hardly moved.
// Gives   the structure without that joint, its two links as one. Errors of poses that stay for
//         seconds (a compressed video repeats its picture) look like a joint of some channel.
#pragma once

#include <cstddef>

#include "kinematics/log/joint_log.h"
#include "kinematics/structure/structure.h"

namespace kinescope {

/// It moved over no more than what it leaves of the poses makes of a joint at rest.
[[nodiscard]] bool hardly_moves(const StructureJoint& joint);

/// The joint's value, rad or m, at the median reading of its channel, or the median of the values
/// that no channel drives; 0 where there is neither.
[[nodiscard]] double usual_value(const Structure& structure, std::size_t joint,
                                 const JointLog& log);

/// The joint's child becomes part of its parent, as it stands at `value` (rad or m).
[[nodiscard]] Structure with_joint_at_rest(const Structure& structure, std::size_t joint,
                                           double value);

}  // namespace kinescope
