// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/distribution.h"

#include <algorithm>
#include <cmath>

#include <unsupported/Eigen/SpecialFunctions>

namespace kinescope::trace {

double f_survival(double value, double k, double freedom) {
  if (!(value > 0.0)) return 1.0;
  // Abramowitz and Stegun 1964, 26.6.2.
  return Eigen::numext::betainc(freedom / 2.0, k / 2.0, freedom / (freedom + k * value));
}

double quadratic_form_survival(double value, const Eigen::VectorXd& weights) {
  const double most = weights.size() == 0 ? 0.0 : weights.maxCoeff();
  if (!(most > 0.0) || value <= weights.sum()) return 1.0;
  // K'(zeta) = value; K' grows from the mean to infinity as zeta goes from 0 to 1 / (2 most).
  double low = 0.0;
  double high = 0.5 / most;
  constexpr int kHalvings = 100;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    const double slope = (weights.array() / (1.0 - 2.0 * middle * weights.array())).sum();
    (slope < value ? low : high) = middle;
  }
  const double zeta = low;
  const Eigen::ArrayXd left = 1.0 - 2.0 * zeta * weights.array();
  const double cumulant = -0.5 * left.log().sum();
  const double w = std::sqrt(std::max(0.0, 2.0 * (zeta * value - cumulant)));
  const double v = zeta * std::sqrt(2.0 * (weights.array() / left).square().sum());
  constexpr double kAtTheMean = 1e-4;
  if (!(w > kAtTheMean)) return 0.5;
  return 0.5 * std::erfc((w + std::log(v / w) / w) / std::sqrt(2.0));
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
