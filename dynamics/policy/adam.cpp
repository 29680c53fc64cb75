// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/adam.h"

#include <algorithm>
#include <cmath>

namespace kinescope::policy {

void adam_step(const Eigen::VectorXd& gradient, SearchState& search) {
  constexpr double kFirst = 0.9;
  constexpr double kSecond = 0.999;
  constexpr double kEpsilon = 1e-8;
  ++search.adam_step;
  search.first_moment = kFirst * search.first_moment + (1.0 - kFirst) * gradient;
  search.second_moment = kSecond * search.second_moment + (1.0 - kSecond) * gradient.cwiseAbs2();
  const double first = 1.0 - std::pow(kFirst, search.adam_step);
  const double second = 1.0 - std::pow(kSecond, search.adam_step);
  const Eigen::ArrayXd root = (search.second_moment.array() / second).sqrt() + kEpsilon;
  const Eigen::VectorXd change =
      (search.learning_rate / first * search.first_moment.array() / root).matrix();
  search.policy = with_parameters(std::move(search.policy), parameters_of(search.policy) - change);
}

void limit_gradient(double limit, Eigen::VectorXd& gradient, SearchState& search) {
  constexpr double kMemory = 0.95;  // 20 steps
  const double length = gradient.norm();
  if (search.gradient_scale <= 0.0) search.gradient_scale = length;
  const double longest = limit * search.gradient_scale;
  if (limit > 0.0 && length > longest) gradient *= longest / length;
  const double entered = limit > 0.0 ? std::min(length, longest) : length;
  search.gradient_scale = kMemory * search.gradient_scale + (1.0 - kMemory) * entered;
}

bool note_cost(double cost, const ImproveOptions& options, SearchState& search) {
  const double last = search.costs.empty() ? cost : search.costs.back();
  const bool first = search.costs.empty();
  search.costs.push_back(cost);
  if (first) return false;
  const double memory = options.change_memory;
  const double difference = cost - last - search.mean_change;
  search.mean_change += (1.0 - memory) * difference;
  search.change_variance =
      memory * (search.change_variance + (1.0 - memory) * difference * difference);
  const bool progress =
      -search.mean_change > options.change_ratio * std::sqrt(search.change_variance);
  search.steps_without_progress = progress ? 0 : search.steps_without_progress + 1;
  if (search.steps_without_progress < options.patience) return false;
  if (search.learning_rate <= options.min_learning_rate) return true;
  search.learning_rate = std::max(0.5 * search.learning_rate, options.min_learning_rate);
  search.dropout = std::max(0.0, search.dropout - options.dropout_decrement);
  search.steps_without_progress = 0;
  search.mean_change = 0.0;
  search.change_variance = 0.0;
  return false;
}

}  // namespace kinescope::policy
