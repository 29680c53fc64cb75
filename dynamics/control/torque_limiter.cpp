// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/torque_limiter.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace kinescope {

TorqueLimiter::TorqueLimiter(TorqueLimits limits, Eigen::Index joints, double period_s)
    : limits_(std::move(limits)),
      period_s_(period_s),
      sent_(Eigen::VectorXd::Zero(joints)),
      limited_(Eigen::VectorXi::Zero(joints)),
      replaced_(Eigen::VectorXi::Zero(joints)) {}

const Eigen::VectorXd& TorqueLimiter::apply(const Eigen::VectorXd& wanted) {
  for (Eigen::Index j = 0; j < sent_.size(); ++j) {
    if (!std::isfinite(wanted[j])) {
      ++replaced_[j];
      continue;
    }
    double torque = wanted[j];
    if (limits_.largest.size() > 0) {
      torque = std::clamp(torque, -limits_.largest[j], limits_.largest[j]);
    }
    if (limits_.rate_per_s.size() > 0 && begun_) {
      const double step = limits_.rate_per_s[j] * period_s_;
      torque = std::clamp(torque, sent_[j] - step, sent_[j] + step);
    }
    if (torque != wanted[j]) ++limited_[j];
    sent_[j] = torque;
  }
  begun_ = true;
  return sent_;
}

}  // namespace kinescope
