// SPDX-License-Identifier: Apache-2.0
//
// Smooth functions of one number, as a Gaussian process on few nodes.
#pragma once

#include <Eigen/Core>

namespace kinescope::effects {

/// With independent coefficients of standard normal distribution the functions are draws of a
/// Gaussian process (zero mean, variance 1, squared exponential of `length`) conditioned on nodes
/// closer than that; beyond [low, high] they fade to nothing within two lengths. Quiñonero-Candela
/// and Rasmussen 2005, section 5 (subset of regressors).
class SmoothBasis {
 public:
  /// low <= high, length > 0, all in the unit of the values.
  SmoothBasis(double low, double high, double length);

  /// Values x coefficients.
  [[nodiscard]] Eigen::MatrixXd at(const Eigen::VectorXd& values) const;

 private:
  Eigen::MatrixXd kernel(const Eigen::VectorXd& values) const;

  double length_;
  Eigen::VectorXd nodes_;
  Eigen::MatrixXd whitening_;  // nodes x size
};

}  // namespace kinescope::effects
