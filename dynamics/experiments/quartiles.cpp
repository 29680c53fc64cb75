// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/quartiles.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kinematics/core/error.h"

namespace kinescope::experiments {

Quartiles quartiles(std::vector<double> values) {
  KINESCOPE_CHECK(!values.empty(), "quartiles of something");
  std::ranges::sort(values);
  const auto at = [&](double share) {
    const double place = share * static_cast<double>(values.size() - 1);
    const auto low = static_cast<std::size_t>(std::floor(place));
    const std::size_t high = std::min(low + 1, values.size() - 1);
    return values[low] + (place - std::floor(place)) * (values[high] - values[low]);
  };
  return {at(0.25), at(0.5), at(0.75)};
}

Interval median_interval(std::vector<double> values) {
  constexpr double kOutside = 0.05;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::ranges::sort(values);
  const auto n = static_cast<double>(values.size());
  // P(fewer than k of n values lie below the median), binomial of 1/2.
  double term = std::exp2(-n);
  double below = term;
  std::size_t k = 0;
  while (k < values.size() / 2 && 2.0 * below <= kOutside) {
    ++k;
    term *= (n - static_cast<double>(k) + 1.0) / static_cast<double>(k);
    below += term;
  }
  if (k == 0) return {nan, nan};
  return {values[k - 1], values[values.size() - k]};
}

}  // namespace kinescope::experiments
