// SPDX-License-Identifier: Apache-2.0
//
// The logarithm of a motion about its mean, and what linear regression says of it.
#pragma once

#include <vector>

#include "kinematics/structure/chain.h"

namespace kinescope::structure_search {

/// y(t) = log(mean^-1 T(t)), once whitened with one average matrix (quick regressions on many
/// channels), once with the whitening of every sample: what a planar marker shows badly (depth,
/// tilt) turns with it, and an average takes that for motion.
struct LinearMotion {
  Pose mean;
  Matrix6d whitening;         ///< average; upper triangular
  Eigen::MatrixXd y;          ///< 6 x samples, whitened, centred over the kept samples
  Eigen::VectorXd weight;     ///< of each sample: its information over the average one
  std::vector<char> kept;     ///< samples that are no outliers
  int count = 0;              ///< kept ones
  double widest = 0.0;        ///< largest rotation from the mean, rad
  Eigen::MatrixXd tangent;    ///< y, 6 x samples, rad and m
  std::vector<Matrix6d> own;  ///< whitening of each column of `tangent`
};

[[nodiscard]] LinearMotion linear_motion(const Motion& motion);

/// The tangent regressed on a coordinate: tangent = mean + slope * coordinate.
struct LineFit {
  Vector6d mean = Vector6d::Zero();
  Vector6d slope = Vector6d::Zero();
  double turn_evidence = 0.0;  ///< rotation of the slope over its standard deviation
  double cost = 0.0;           ///< -2 ln likelihood, noise scale free but >= 1
};

/// Generalised least squares with every sample's own whitening, robust, from `start` (which says
/// which samples are outliers). A slide's slope has no rotation.
[[nodiscard]] LineFit fit_line(const LinearMotion& linear, const Eigen::VectorXd& coordinate,
                               JointType type, const LineFit& start);
/// The same for coordinates that are free at every sample; they start as given and are improved.
[[nodiscard]] LineFit fit_free_line(const LinearMotion& linear, Eigen::VectorXd& coordinate,
                                    JointType type, const LineFit& start);
/// Nothing moves: the mean alone. The start's slope is not used.
[[nodiscard]] LineFit fit_point(const LinearMotion& linear, const LineFit& start);

/// -2 ln likelihood of residual sums split along (1) and across (5) a direction, noise scale free
/// but >= 1.
[[nodiscard]] double split_cost(double along_sum, double across_sum, int samples);

/// Cost of the same residuals under a free motion with the covariance of y.
[[nodiscard]] double free_motion_cost(const LinearMotion& linear);

}  // namespace kinescope::structure_search
