// SPDX-License-Identifier: Apache-2.0
//
// Turns so wide that the logarithm wraps: rotation vectors unwrapped along the sorted channel, or
// time.
#pragma once

#include <vector>

#include "kinematics/structure/screening.h"

namespace kinescope::structure_search {

/// Beyond this rotation from the mean (rad) the logarithm is too close to its cut.
inline constexpr double kWideTurn = 2.3;

/// Starts for a turn by any number of revolutions. `q`: channels x samples.
[[nodiscard]] std::vector<Candidate> wide_turn_candidates(const Motion& motion,
                                                          const Eigen::MatrixXd& q,
                                                          const std::vector<char>& usable,
                                                          bool coordinate_free);

}  // namespace kinescope::structure_search
