// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/velocity_estimator.h"

#include <cmath>
#include <numbers>

namespace kinescope {

VelocityEstimator::VelocityEstimator(const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                                     double rate_hz, double cutoff_hz)
    : last_q_(q),
      dq_(dq),
      rate_hz_(rate_hz),
      share_(-std::expm1(-2.0 * std::numbers::pi * cutoff_hz / rate_hz)) {}

const Eigen::VectorXd& VelocityEstimator::update(const Eigen::VectorXd& q) {
  dq_ += share_ * ((q - last_q_) * rate_hz_ - dq_);
  last_q_ = q;
  return dq_;
}

}  // namespace kinescope
