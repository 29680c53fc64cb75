// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/distribution.h"

#include <cmath>

#include <unsupported/Eigen/SpecialFunctions>

namespace kinescope::trace {

double f_survival(double value, double k, double freedom) {
  if (!(value > 0.0)) return 1.0;
  // Abramowitz and Stegun 1964, 26.6.2.
  return Eigen::numext::betainc(freedom / 2.0, k / 2.0, freedom / (freedom + k * value));
}

double f_quantile(double p, double k, double freedom) {
  double low = 0.0;
  double high = 1.0;
  while (f_survival(high, k, freedom) > p && high < 1e12) high *= 2.0;
  constexpr int kHalvings = 80;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (f_survival(middle, k, freedom) > p ? low : high) = middle;
  }
  return high;
}

double t_quantile(double p, double freedom) { return std::sqrt(f_quantile(2.0 * p, 1.0, freedom)); }

}  // namespace kinescope::trace
