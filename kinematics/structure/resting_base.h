// SPDX-License-Identifier: Apache-2.0
//
// Takes   a structure in which everything that is seen moves with one joint that no channel drives,
//         or only one that explains less than half of its motion.
// Gives   the same robot on a base at rest: a camera that moves looks like such a joint, of
//         whatever channel rises with time, too.
#pragma once

#include <optional>

#include "kinematics/structure/structure.h"

namespace kinescope {

/// The joint's child, where it mostly stands, becomes link 0. Nothing for other structures.
[[nodiscard]] std::optional<Structure> with_base_at_rest(const Structure& structure,
                                                         const JointLog& log);

}  // namespace kinescope
