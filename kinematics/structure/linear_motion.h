// SPDX-License-Identifier: Apache-2.0
//
// The logarithm of a motion about its mean, and what linear regression says of it.
#pragma once

#include <vector>

#include "kinematics/structure/chain.h"

namespace kinescope::structure_search {

/// y(t) = log(mean^-1 T(t)), whitened with one average matrix for quick regressions on many
/// channels.
struct LinearMotion {
  Pose mean;
  Matrix6d whitening;       ///< average; upper triangular
  Eigen::MatrixXd y;        ///< 6 x samples, whitened, centred over the kept samples
  Eigen::VectorXd weight;   ///< of each sample: its information over the average one
  std::vector<char> kept;   ///< samples that are no outliers
  int count = 0;            ///< kept ones
  double widest = 0.0;      ///< largest rotation from the mean, rad
  Eigen::MatrixXd tangent;  ///< y, 6 x samples, rad and m
};

[[nodiscard]] LinearMotion linear_motion(const Motion& motion);

/// Whitening of the logarithm y of a sample.
[[nodiscard]] Matrix6d tangent_whitening(const MotionSample& sample, const Vector6d& y);

/// -2 ln likelihood of residual sums split along (1) and across (5) a direction, noise scale free
/// but >= 1.
[[nodiscard]] double split_cost(double along_sum, double across_sum, int samples);

/// Cost of the same residuals under a free motion with the covariance of y.
[[nodiscard]] double free_motion_cost(const LinearMotion& linear);

}  // namespace kinescope::structure_search
