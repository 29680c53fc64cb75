// SPDX-License-Identifier: Apache-2.0
//
// Quintic smoothing spline with a cut-off in Hz: minimises the weighted squares of y - f plus
// lambda times the integral of f'''^2. Its frequency response is 1 / (1 + (sqrt 2 - 1) (f /
// cutoff)^6), that of a third-order Butterworth filter run forward and backward, but it takes
// uneven stamps, needs no padding at the ends and gives derivatives without differences. Source:
// Craven and Wahba 1979 (equivalent filter); Eilers and Marx 1996 (B-spline basis).
#pragma once

#include <Eigen/Core>

namespace kinescope {

class SmoothingSpline {
 public:
  /// `t_s` strictly increasing, at least 8; `values` samples x signals. Samples are weighted by the
  /// time they stand for, so that the cut-off does not depend on their density. O(samples x
  /// signals).
  SmoothingSpline(const Eigen::VectorXd& t_s, const Eigen::MatrixXd& values, double cutoff_hz);
  /// The same with the samples' own weights, positive with a mean of 1. The cut-off is that of even
  /// samples of equal weight.
  SmoothingSpline(const Eigen::VectorXd& t_s, const Eigen::MatrixXd& values,
                  const Eigen::VectorXd& weights, double cutoff_hz);

  /// The `derivative`-th derivative (0 to 2) at times inside the data: times x signals.
  [[nodiscard]] Eigen::MatrixXd evaluate(const Eigen::VectorXd& t_s, int derivative = 0) const;

 private:
  double start_s_ = 0.0;
  double knot_step_s_ = 1.0;
  Eigen::Index intervals_ = 0;
  Eigen::MatrixXd coefficients_;  ///< basis functions x signals
};

}  // namespace kinescope
