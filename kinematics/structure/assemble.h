// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grown tree. Gives the Structure: links with reference markers, joints with z on the
// axis and the reading itself (in SI units) as value.
#pragma once

#include "kinematics/structure/growth.h"
#include "kinematics/structure/structure.h"
#include "kinematics/structure/verdict.h"

namespace kinescope::structure_search {

/// `tree` fitted to `full` (every frame); `readings` at its instants.
[[nodiscard]] Structure assemble(const GrownTree& tree, const Series& full,
                                 const Readings& readings, const Verdict& verdict);

}  // namespace kinescope::structure_search
