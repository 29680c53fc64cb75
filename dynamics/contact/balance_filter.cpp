// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/balance_filter.h"

#include <cmath>
#include <utility>

#include "kinematics/core/error.h"

namespace kinescope::contact {

void momentum_covariance(const BalanceSample& sample, const BalanceNoise& noise,
                         Eigen::MatrixXd& out) {
  if (sample.mass.size() == 0) {
    out.setZero();
    return;
  }
  for (Eigen::Index a = 0; a < out.rows(); ++a) {
    for (Eigen::Index b = 0; b <= a; ++b) {
      double sum = 0.0;
      for (Eigen::Index j = 0; j < out.cols(); ++j) {
        sum += sample.mass(a, j) * sample.mass(b, j) * noise.velocity_sigma[j] *
               noise.velocity_sigma[j];
      }
      out(a, b) = out(b, a) = sum;
    }
  }
}

bool inverse_cholesky(Eigen::MatrixXd& matrix) {
  const Eigen::Index n = matrix.rows();
  for (Eigen::Index c = 0; c < n; ++c) {
    for (Eigen::Index r = c; r < n; ++r) {
      double sum = matrix(r, c);
      for (Eigen::Index k = 0; k < c; ++k) sum -= matrix(r, k) * matrix(c, k);
      if (r == c) {
        if (!(sum > 0.0)) return false;
        matrix(c, c) = std::sqrt(sum);
      } else {
        matrix(r, c) = sum / matrix(c, c);
      }
    }
  }
  for (Eigen::Index c = 0; c < n; ++c) {
    matrix(c, c) = 1.0 / matrix(c, c);
    for (Eigen::Index r = c + 1; r < n; ++r) {
      double sum = 0.0;
      for (Eigen::Index k = c; k < r; ++k) sum -= matrix(r, k) * matrix(k, c);
      matrix(r, c) = sum / matrix(r, r);
      matrix(c, r) = 0.0;
    }
  }
  return true;
}

BalanceFilter::BalanceFilter(BalanceNoise noise) : noise_(std::move(noise)) {
  const Eigen::Index n = noise_.torque_sigma.size();
  for (Eigen::VectorXd* v : {&drive_, &sigma_, &p_, &d_, &innovation_, &decay_, &new_sigma_}) {
    *v = Eigen::VectorXd::Zero(n);
  }
  stuck_ = Eigen::VectorXi::Zero(n);
  for (Eigen::MatrixXd* m : {&P_pp_, &P_pd_, &P_dd_, &S_, &whitener_, &gain_p_, &gain_d_}) {
    *m = Eigen::MatrixXd::Zero(n, n);
  }
}

void BalanceFilter::start(const BalanceSample& sample) {
  new_sigma_ = noise_.model_sigma.cwiseProduct(sample.sigma);
  start(sample, Eigen::VectorXd::Zero(d_.size()), new_sigma_.cwiseAbs2());
}

void BalanceFilter::start(const BalanceSample& sample, const Eigen::VectorXd& error_mean,
                          const Eigen::VectorXd& error_variance) {
  started_ = true;
  stamp_s_ = sample.stamp_s;
  drive_ = sample.drive;
  sigma_ = noise_.model_sigma.cwiseProduct(sample.sigma);
  for (Eigen::Index j = 0; j < stuck_.size(); ++j) stuck_[j] = sample.may_stick(j) ? 1 : 0;
  p_ = sample.momentum;
  d_ = error_mean;
  momentum_covariance(sample, noise_, P_pp_);
  P_pd_.setZero();
  P_dd_.setZero();
  P_dd_.diagonal() = error_variance;
}

void BalanceFilter::advance(const BalanceSample& sample) {
  step_s_ = sample.stamp_s - stamp_s_;
  predict(sample);
  correct(sample);
  stamp_s_ = sample.stamp_s;
  drive_ = sample.drive;
  sigma_ = new_sigma_;
}

void BalanceFilter::predict(const BalanceSample& sample) {
  const double dt = step_s_;
  p_ += dt * (0.5 * (drive_ + sample.drive) + d_);
  P_pp_ += dt * (P_pd_ + P_pd_.transpose().eval()) + dt * dt * P_dd_;
  P_pd_ += dt * P_dd_;
  for (Eigen::Index j = 0; j < d_.size(); ++j) {
    // While a joint sticks nothing is learned of the model's error, which begins anew with sliding.
    const int sticks = sample.may_stick(j) ? 1 : 0;
    decay_[j] = sticks == stuck_[j] ? std::exp(-dt / noise_.model_time_s[j]) : 0.0;
    stuck_[j] = sticks;
    const double white = dt * noise_.torque_sigma[j];
    P_pp_(j, j) += white * white;
  }
  P_pd_ = P_pd_ * decay_.asDiagonal();
  P_dd_ = decay_.asDiagonal() * P_dd_ * decay_.asDiagonal();
  d_ = d_.cwiseProduct(decay_);
  // The error's variance follows the model's own doubt: at once when it grows.
  new_sigma_ = noise_.model_sigma.cwiseProduct(sample.sigma);
  for (Eigen::Index j = 0; j < d_.size(); ++j) {
    const double kept = decay_[j] * decay_[j];
    const double smaller = std::min(sigma_[j], new_sigma_[j]);
    P_dd_(j, j) += new_sigma_[j] * new_sigma_[j] - kept * smaller * smaller;
  }
}

void BalanceFilter::correct(const BalanceSample& sample) {
  momentum_covariance(sample, noise_, S_);
  S_ += P_pp_;
  whitener_ = S_;
  const bool definite = inverse_cholesky(whitener_);
  KINESCOPE_CHECK(definite, "the innovation's covariance is positive definite");
  innovation_.noalias() = whitener_ * (sample.momentum - p_);
  gain_p_.noalias() = whitener_ * P_pp_;
  gain_d_.noalias() = whitener_ * P_pd_;
  p_.noalias() += gain_p_.transpose() * innovation_;
  d_.noalias() += gain_d_.transpose() * innovation_;
  P_pp_.noalias() -= gain_p_.transpose() * gain_p_;
  P_pd_.noalias() -= gain_p_.transpose() * gain_d_;
  P_dd_.noalias() -= gain_d_.transpose() * gain_d_;
}

}  // namespace kinescope::contact
