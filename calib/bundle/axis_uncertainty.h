// SPDX-License-Identifier: Apache-2.0
//
// How exactly each joint's axis is known: in the base, and among the other axes.
#pragma once

#include <vector>

#include "calib/bundle/calibration.h"
#include "calib/bundle/problem.h"
#include "calib/bundle/uncertainty.h"

namespace kinescope::bundle {

/// Half the length that an error of this covariance stays below in 95 of 100 cases, so that twice
/// it is an interval of that kind however the error is spread over directions. The squared length
/// is taken as a scaled chi-square of the same mean and variance (Satterthwaite 1946). Nothing
/// where the covariance is not finite or says nothing.
[[nodiscard]] Sigma length_sigma(const Eigen::MatrixXd& covariance);

/// Fills the sigmas of axes in `joints`, one entry a joint of the tree, all joints at `values`.
/// `held` joints, and those of a parameter that is unseen, are left without. Among one another: the
/// same after the motion of the base that makes the errors of all axes smallest is taken out (inner
/// constraints; Baarda 1973), directions and places weighed by the extent of the robot; left out
/// where that takes up all there is, as with a single axis.
void fill_axis_uncertainty(const Spec& spec, const State& state, const Uncertainty& uncertainty,
                           const KinematicTree& tree, const Eigen::VectorXd& values,
                           const std::vector<bool>& held, std::vector<JointEstimate>& joints);

}  // namespace kinescope::bundle
