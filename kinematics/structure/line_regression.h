// SPDX-License-Identifier: Apache-2.0
//
// The logarithm of a motion regressed on one coordinate with the whitening of every sample: what a
// planar marker shows badly (depth, tilt) turns with it, and an average takes that for motion.
#pragma once

#include "kinematics/structure/linear_motion.h"

namespace kinescope::structure_search {

/// The tangent of a motion with the whitening of every sample, and the products that regressions
/// on any coordinate share.
struct LineProblem {
  Eigen::MatrixXd whitening;  ///< 6 samples x 6: of each sample, below one another
  Eigen::MatrixXd white;      ///< 6 x samples: the whitened tangent
  Eigen::MatrixXd moments;    ///< samples x 27: lower half of W'W by columns, then W'W tangent
};

[[nodiscard]] LineProblem line_problem(const LinearMotion& linear, const Motion& motion);

/// The tangent regressed on a coordinate: tangent = mean + slope * coordinate.
struct LineFit {
  Vector6d mean = Vector6d::Zero();
  Vector6d slope = Vector6d::Zero();
  double turn_evidence = 0.0;  ///< rotation of the slope over its standard deviation
  double cost = 0.0;           ///< -2 ln likelihood, noise scale free but >= 1
  double across = 1.0;         ///< that noise scale across the slope (variance over declared)
};

/// Generalised least squares with every sample's own whitening, robust, from `start` (which says
/// which samples are outliers). A slide's slope has no rotation.
[[nodiscard]] LineFit fit_line(const LineProblem& problem, const Eigen::VectorXd& coordinate,
                               JointType type, const LineFit& start);
/// The same for coordinates that are free at every sample; they start as given and are improved.
[[nodiscard]] LineFit fit_free_line(const LineProblem& problem, Eigen::VectorXd& coordinate,
                                    JointType type, const LineFit& start);
/// Nothing moves: the mean alone. The start's slope is not used.
[[nodiscard]] LineFit fit_point(const LineProblem& problem, const LineFit& start);

}  // namespace kinescope::structure_search
