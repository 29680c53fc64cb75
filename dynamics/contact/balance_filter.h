// SPDX-License-Identifier: Apache-2.0
//
// Follows momentum and the model's error through time as if nothing touched the robot: a Kalman
// filter with the states p (momentum) and d (the model's error in torque),
//     p' = p + dt (drive + d + white),   d' = a d + white,   measured momentum = p + M white.
// Its innovations are white until a contact begins.
#pragma once

#include "dynamics/contact/balance.h"
#include "dynamics/contact/balance_noise.h"

namespace kinescope::contact {

class BalanceFilter {
 public:
  explicit BalanceFilter(BalanceNoise noise);

  /// Begins at a sample; the model's error is distributed as (mean, variance) says, or as the noise
  /// model does.
  void start(const BalanceSample& sample);
  void start(const BalanceSample& sample, const Eigen::VectorXd& error_mean,
             const Eigen::VectorXd& error_variance);
  [[nodiscard]] bool started() const { return started_; }

  /// One sample on. Does not allocate.
  void advance(const BalanceSample& sample);

  /// Of the last step. With S = L L' the innovation's covariance: whitener = L^-1; innovation =
  /// L^-1 (measured - expected); gain_p' and gain_d' take it to the corrections of p and d.
  [[nodiscard]] const Eigen::MatrixXd& whitener() const { return whitener_; }
  [[nodiscard]] const Eigen::VectorXd& innovation() const { return innovation_; }
  [[nodiscard]] const Eigen::MatrixXd& gain_p() const { return gain_p_; }
  [[nodiscard]] const Eigen::MatrixXd& gain_d() const { return gain_d_; }
  [[nodiscard]] const Eigen::VectorXd& decay() const { return decay_; }
  [[nodiscard]] double step_s() const { return step_s_; }

  [[nodiscard]] const Eigen::VectorXd& error_mean() const { return d_; }
  [[nodiscard]] const Eigen::MatrixXd& error_covariance() const { return P_dd_; }
  [[nodiscard]] const BalanceNoise& noise() const { return noise_; }

 private:
  void predict(const BalanceSample& sample);
  void correct(const BalanceSample& sample);

  BalanceNoise noise_;
  bool started_ = false;
  double stamp_s_ = 0.0;
  double step_s_ = 0.0;
  Eigen::VectorXd drive_;  ///< of the sample before
  Eigen::VectorXd sigma_;  ///< of the model's error at the sample before
  Eigen::VectorXi stuck_;  ///< BalanceSample::sticks at the sample before
  Eigen::VectorXd p_, d_;
  Eigen::MatrixXd P_pp_, P_pd_, P_dd_;
  Eigen::MatrixXd S_, whitener_, gain_p_, gain_d_;
  Eigen::VectorXd innovation_, decay_, new_sigma_;
};

/// Covariance of the momentum's measurement, M diag(velocity_sigma^2) M'; zero without a mass.
void momentum_covariance(const BalanceSample& sample, const BalanceNoise& noise,
                         Eigen::MatrixXd& out);

/// In place, lower triangle of a symmetric matrix to its Cholesky factor and on to that factor's
/// inverse, upper triangle zero. For the few rows of a robot, where a library's call costs more.
/// False where the matrix is not positive definite.
[[nodiscard]] bool inverse_cholesky(Eigen::MatrixXd& matrix);

}  // namespace kinescope::contact
