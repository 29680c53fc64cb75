// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grown tree, the series it stands for, and the log.
// Gives   the clock offset that this tree's likelihood asks for.
// Method  Gauss-Newton on the offset and all joints' parameters together: moving the clock moves
//         every joint by its rate, so the derivative of a link's path runs down the tree with the
//         twists of its joints; the parameters are eliminated body by body (Schur complement).
#pragma once

#include "kinematics/log/joint_log.h"
#include "kinematics/structure/grown_tree.h"

namespace kinescope::structure_search {

struct TimeOffset {
  double value_s = 0.0;
  double sigma_s = 0.0;
};

struct OffsetBounds {
  double most_s = 1.0;     ///< to either side
  double step_s = 0.1;     ///< most in one step
  double max_gap_s = 0.5;  ///< of the log
};

/// `readings` are those of the tree, at `start_s`. It may have been grown on another series.
[[nodiscard]] TimeOffset refine_offset(const GrownTree& tree, const Series& series,
                                       const Readings& readings, const JointLog& log,
                                       double start_s, const OffsetBounds& bounds);

}  // namespace kinescope::structure_search
