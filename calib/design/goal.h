// SPDX-License-Identifier: Apache-2.0
//
// What a recording is to make known, as linear functions of the parameters: their mean variance is
// I-optimality (also V- or Q-optimality; Fedorov 1972, section 2.9). Units m: sqrt of that is a
// standard uncertainty.
#pragma once

#include "calib/design/planned_robot.h"

namespace kinescope::design {

enum class Goal {
  kTip,  ///< where the markers of the last links are, over the joints' ranges
  kAxes  ///< where two points on each axis are, sideways, in the middle of the ranges
};

/// P x r, for `parameters` of expected_rows(): trace(root' covariance root) is the mean square
/// error of a point, m^2, after the motion of the base that makes all of them smallest is taken out
/// (as among_position_sigma_m: where the base stands is each recording's own).
[[nodiscard]] Eigen::MatrixXd goal_root(Goal goal, const PlannedRobot& robot,
                                        const JointSpace& space,
                                        const std::vector<Parameter>& parameters, Rng& rng);

}  // namespace kinescope::design
