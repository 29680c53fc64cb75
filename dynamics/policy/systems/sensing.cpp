// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/sensing.h"

#include <cmath>
#include <numbers>

#include "dynamics/data/zero_phase_filter.h"

namespace kinescope::policy {

double low_pass_weight(double share_of_rate) {
  return 1.0 - std::exp(-2.0 * std::numbers::pi * share_of_rate);
}

SpeedEstimator::SpeedEstimator(double step_s, double share_of_rate)
    : step_s_(step_s), weight_(low_pass_weight(share_of_rate)) {}

Eigen::VectorXd SpeedEstimator::update(const Eigen::VectorXd& positions) {
  if (last_.size() == 0) {
    speed_ = Eigen::VectorXd::Zero(positions.size());
  } else {
    speed_ += weight_ * ((positions - last_) / step_s_ - speed_);
  }
  last_ = positions;
  Eigen::VectorXd out(2 * positions.size());
  out << positions, speed_;
  return out;
}

Eigen::MatrixXd smoothed_states(const Eigen::MatrixXd& positions, double step_s,
                                double share_of_rate) {
  constexpr int kOrder = 2;
  const Eigen::MatrixXd smooth =
      filter_zero_phase(positions, kOrder, share_of_rate / step_s, 1.0 / step_s);
  Eigen::MatrixXd out(positions.rows(), 2 * positions.cols());
  out << smooth, central_differences(smooth, step_s);
  return out;
}

}  // namespace kinescope::policy
