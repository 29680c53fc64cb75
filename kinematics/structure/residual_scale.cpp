// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/residual_scale.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/median.h"
#include "kinematics/structure/series.h"

namespace kinescope::structure_search {
namespace {

// Mean of the values over `dof` within the trim; starts from the median.
double trimmed_variance(const std::vector<double>& squared, double dof, double median_unit) {
  double variance = median_of(squared) / median_unit;
  for (int pass = 0; pass < 2 && variance > 0.0; ++pass) {
    double sum = 0.0;
    int count = 0;
    for (const double s : squared) {
      if (s > kTrim * variance * (dof > 1.0 ? 1.0 : 0.5)) continue;
      sum += s;
      ++count;
    }
    if (count > 0) variance = sum / (count * dof);
  }
  return variance;
}

double squared_of(const ResidualParts& p, const ResidualScale& s, std::size_t i) {
  return p.across[i] / s.across + p.along[i] * p.along[i] / s.along;
}

}  // namespace

ResidualScale residual_scale(const ResidualParts& parts, std::optional<double> most_cost) {
  ResidualScale scale;
  const double dof = parts.split ? 5.0 : 6.0;
  scale.raw_across = trimmed_variance(parts.across, dof, parts.split ? kMedian5 : kMedian6);
  scale.across = std::max(1.0, scale.raw_across);
  const auto samples = static_cast<double>(parts.across.size());
  if (parts.split && !parts.free_axis) {
    std::vector<double> squared;
    squared.reserve(parts.along.size());
    for (const double a : parts.along) squared.push_back(a * a);
    scale.along = std::max(1.0, trimmed_variance(squared, 1.0, 0.4549));
  }
  if (parts.free_axis && !most_cost) most_cost = kOutlierCost;
  for (std::size_t i = 0; i < parts.across.size(); ++i) {
    const double squared = squared_of(parts, scale, i) + parts.penalty[i];
    scale.cost += most_cost ? std::min(squared, *most_cost) : tailed_cost(squared);
  }
  scale.cost += samples * (dof * std::log(scale.across) + std::log(scale.along));
  return scale;
}

std::vector<double> robust_weights(const ResidualParts& parts, const ResidualScale& scale) {
  constexpr double kKnee = 20.0;
  std::vector<double> weights;
  weights.reserve(parts.across.size());
  for (std::size_t i = 0; i < parts.across.size(); ++i) {
    const double u = kKnee / (kKnee + squared_of(parts, scale, i));
    weights.push_back(u * u);
  }
  return weights;
}

double integrated_autocorrelation(const std::vector<Vector6d>& residuals) {
  constexpr double kClip = 4.0;
  const auto n = static_cast<Eigen::Index>(residuals.size());
  if (n < 12) return 1.0;
  Eigen::MatrixXd r(6, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    r.col(i) = residuals[static_cast<std::size_t>(i)].cwiseMax(-kClip).cwiseMin(kClip);
  }
  const double power = r.squaredNorm() / static_cast<double>(n);
  if (!(power > 0.0)) return 1.0;
  double sum = 1.0;
  const Eigen::Index longest = std::min<Eigen::Index>(n / 4, 60);
  const double noise = 2.0 / std::sqrt(6.0 * static_cast<double>(n));
  for (Eigen::Index lag = 1; lag <= longest; ++lag) {
    const double covariance =
        r.leftCols(n - lag).cwiseProduct(r.rightCols(n - lag)).sum() / static_cast<double>(n - lag);
    const double correlation = covariance / power;
    if (correlation < noise) break;
    sum += 2.0 * correlation;
  }
  return sum;
}

}  // namespace kinescope::structure_search
