// SPDX-License-Identifier: Apache-2.0
//
// The chi-square distribution by its cube root, which is nearly normal: good to three per cent from
// one degree of freedom on, better with more. Wilson and Hilferty, "The distribution of
// chi-square", 1931.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace kinescope {

/// What a variable of so many degrees of freedom (> 0, any real number) exceeds with the
/// probability that a standard normal one exceeds z; 0: the median.
[[nodiscard]] inline double chi_square_quantile(double freedom, double z) {
  const double c = 2.0 / (9.0 * freedom);
  const double root = std::max(0.0, 1.0 - c + z * std::sqrt(c));
  return freedom * root * root * root;
}

/// Probability that it exceeds x.
[[nodiscard]] inline double chi_square_tail(double x, double freedom) {
  const double c = 2.0 / (9.0 * freedom);
  const double z = (std::cbrt(x / freedom) - (1.0 - c)) / std::sqrt(c);
  return 0.5 * std::erfc(z / std::numbers::sqrt2);
}

}  // namespace kinescope
