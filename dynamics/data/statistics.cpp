// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/statistics.h"

#include <algorithm>
#include <cmath>

namespace kinescope {

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const double at = share * static_cast<double>(values.size() - 1);
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(std::lround(at));
  std::ranges::nth_element(values, nth);
  return *nth;
}

double share_of(Eigen::Index part, Eigen::Index whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

std::vector<double> to_vector(const Eigen::Ref<const Eigen::VectorXd>& values) {
  return {values.data(), values.data() + values.size()};
}

Slope slope_through_origin(const std::vector<double>& x, const std::vector<double>& y) {
  double xx = 0.0;
  double xy = 0.0;
  double yy = 0.0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    xx += x[k] * x[k];
    xy += x[k] * y[k];
    yy += y[k] * y[k];
  }
  if (xx <= 0.0 || yy <= 0.0) return {};
  return {xy / xx, xy * xy / (xx * yy)};
}

std::vector<double> steps_of(const Eigen::VectorXd& t_s, const Eigen::VectorXi& trajectory) {
  std::vector<double> steps;
  for (Eigen::Index row = 1; row < t_s.size(); ++row) {
    if (trajectory(row) == trajectory(row - 1)) steps.push_back(t_s(row) - t_s(row - 1));
  }
  return steps;
}

}  // namespace kinescope
