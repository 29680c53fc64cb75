// SPDX-License-Identifier: Apache-2.0
//
// Takes   a structure with a joint too many.
// Gives   the structure without it. Errors of poses that stay for seconds (a compressed video
//         repeats its picture) look like a joint of some channel that hardly moves. And a marker on
//         a link that was passed over (several joints in series, found as one) hangs further out,
//         on a joint that undoes the last of them.
#pragma once

#include <cstddef>
#include <optional>

#include "kinematics/log/joint_log.h"
#include "kinematics/structure/structure.h"

namespace kinescope {

/// Over no more than what the errors of the poses make of a joint at rest.
[[nodiscard]] bool hardly_moves(const StructureJoint& joint);

/// The joint's value, rad or m, at the median reading of its channel, or the median of the values
/// that no channel drives; 0 where there is neither.
[[nodiscard]] double usual_value(const Structure& structure, std::size_t joint,
                                 const JointLog& log);

/// The joint's child becomes part of its parent, as it stands at the usual value.
[[nodiscard]] Structure with_joint_at_rest(const Structure& structure, std::size_t joint,
                                           const JointLog& log);

/// The joint's child becomes part of the link before its parent, as it stands at the usual values.
/// Nothing where the joint is not driven by the channel that drives its parent.
[[nodiscard]] std::optional<Structure> with_joint_undone(const Structure& structure,
                                                         std::size_t joint, const JointLog& log);

}  // namespace kinescope
