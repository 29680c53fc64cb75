// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "kinematics/core/median.h"

namespace kinescope {

/// s, between one stamp and the next, of two stamps or more.
[[nodiscard]] inline double mean_step_s(const std::vector<double>& times_s) {
  return (times_s.back() - times_s.front()) / static_cast<double>(times_s.size() - 1);
}

/// The usual one, s, which gaps do not change; 0 of fewer than two stamps.
[[nodiscard]] inline double median_step_s(const std::vector<double>& times_s) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < times_s.size(); ++i) steps.push_back(times_s[i] - times_s[i - 1]);
  return median_of(std::move(steps));
}

}  // namespace kinescope
