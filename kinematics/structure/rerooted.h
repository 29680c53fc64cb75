// SPDX-License-Identifier: Apache-2.0
//
// Takes   a structure found from a camera that rides on the robot.
// Gives   the same robot from its base: in the camera's frame the chain begins at the camera and
//         ends at what stands still in the world, so that its joints stand in reverse order.
#pragma once

#include <optional>
#include <span>

#include "kinematics/structure/structure.h"

namespace kinescope {

/// `link` becomes link 0, its first marker the frame that the structure stands in. Joints on the
/// way are turned round: T_child_parent = exp(-axis q) inverts T_parent_child, so the axis points
/// the other way and the value stays. The camera is the reference of the link that `camera_link`
/// names.
[[nodiscard]] Structure rerooted(const Structure& structure, int link);

/// The link that stands still in the world, seen from a camera on the robot: the one that carries
/// the first of `fixed_tags`; else the end of the chain; of several ends the one whose last joint's
/// channel stands first in the log. Nothing where nothing moves, or the tag is not seen.
[[nodiscard]] std::optional<int> link_at_rest(const Structure& structure, const JointLog& log,
                                              std::span<const TagId> fixed_tags);

/// Whether the log speaks for a camera on the robot: all that is seen is one body, behind a chain
/// of three joints or more whose channels stand in the log from the last joint to the first.
[[nodiscard]] bool is_chain_reversed(const Structure& structure, const JointLog& log);

/// Whether a camera on the robot would see the same: all that is seen is one body.
[[nodiscard]] bool shows_one_body(const Structure& structure);

/// Whether the channels stand in the log as the joints do from link 0 outwards, two of them or more
/// on one way: each behind that of the joint before it.
[[nodiscard]] bool stands_in_order(const Structure& structure, const JointLog& log);

}  // namespace kinescope
