// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/gain_system.h"

#include <algorithm>
#include <cmath>

namespace kinescope::identify {

GainSystem::GainSystem(StackedSystem system, bool wanted, int reference)
    : plain_(std::move(system)), gains_(Eigen::VectorXd::Ones(plain_.torque.cols())) {
  if (!wanted) return;
  Eigen::Index kept = reference;
  if (kept < 0) plain_.torque.colwise().norm().maxCoeff(&kept);
  for (Eigen::Index j = 0; j < plain_.torque.cols(); ++j) {
    if (j != kept) free_.push_back(j);
  }
}

void GainSystem::find_gains(const WeightedFitOptions& options) {
  if (free_.empty()) return;
  WeightedFitOptions plain = options;
  plain.loss = RobustLoss::kNone;
  parameters_ = weighted_fit(plain_, plain).parameters;
  constexpr int kSteps = 50;
  constexpr double kSettled = 1e-8;
  iterate(plain, kSteps, kSettled);
  if (options.loss == RobustLoss::kNone) return;
  // Noise levels and weights chase each other below this; take() adds what is left.
  constexpr int kRobustSteps = 20;
  constexpr double kRobustSettled = 1e-6;
  iterate(options, kRobustSteps, kRobustSettled);
}

void GainSystem::iterate(const WeightedFitOptions& options, int steps, double settled) {
  for (int step = 0; step < steps; ++step) {
    if (take(weighted_fit(extended(), padded(options)).parameters) < settled) return;
  }
}

double GainSystem::take(const Eigen::VectorXd& all) {
  if (free_.empty()) return 0.0;
  parameters_ = all.head(plain_.parameters);
  double largest = 0.0;
  for (std::size_t k = 0; k < free_.size(); ++k) {
    double& gain = gains_[free_[k]];
    const double change = all[plain_.parameters + static_cast<Eigen::Index>(k)];
    gain = std::max(gain + change, 0.1 * gain);  // a gain does not change its sign
    largest = std::max(largest, std::abs(change));
  }
  return largest;
}

StackedSystem GainSystem::final_system() const { return free_.empty() ? plain_ : extended(); }

WeightedFitOptions GainSystem::padded(WeightedFitOptions options) const {
  const auto more = static_cast<Eigen::Index>(free_.size());
  if (options.prior.size() == 0) options.prior = Eigen::VectorXd::Zero(plain_.parameters);
  options.prior.conservativeResize(plain_.parameters + more);
  options.prior.tail(more).setZero();
  return options;
}

StackedSystem GainSystem::extended() const {
  StackedSystem out = plain_;
  out.parameters += static_cast<Eigen::Index>(free_.size());
  for (std::size_t j = 0; j < out.joints.size(); ++j) {
    out.joints[j].W *= gains_[static_cast<Eigen::Index>(j)];
  }
  for (std::size_t k = 0; k < free_.size(); ++k) {
    JointColumns& joint = out.joints[static_cast<std::size_t>(free_[k])];
    const Eigen::VectorXd torque =
        plain_.joints[static_cast<std::size_t>(free_[k])].times(parameters_);
    joint.parameters.push_back(static_cast<int>(plain_.parameters) + static_cast<int>(k));
    joint.W.conservativeResize(Eigen::NoChange, joint.W.cols() + 1);
    joint.W.rightCols<1>() = torque;
  }
  return out;
}

}  // namespace kinescope::identify
