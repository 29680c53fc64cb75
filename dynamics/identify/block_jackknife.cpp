// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/block_jackknife.h"

#include <algorithm>
#include <cmath>

namespace kinescope::identify {
namespace {

/// First row of each run of equal numbers, and the end.
std::vector<Eigen::Index> run_bounds(const Eigen::VectorXi& trajectory) {
  std::vector<Eigen::Index> bounds;
  for (Eigen::Index t = 0; t < trajectory.size(); ++t) {
    if (t == 0 || trajectory[t] != trajectory[t - 1]) bounds.push_back(t);
  }
  bounds.push_back(trajectory.size());
  return bounds;
}

/// Sum of e(t) e(t + lag) within the runs.
double lagged_product(const Eigen::VectorXd& e, const std::vector<Eigen::Index>& bounds,
                      Eigen::Index lag) {
  double sum = 0.0;
  for (std::size_t r = 0; r + 1 < bounds.size(); ++r) {
    const Eigen::Index count = bounds[r + 1] - bounds[r] - lag;
    if (count > 0) sum += e.segment(bounds[r], count).dot(e.segment(bounds[r] + lag, count));
  }
  return sum;
}

}  // namespace

double correlation_samples(const Eigen::MatrixXd& residuals, const Eigen::VectorXi& trajectory) {
  const std::vector<Eigen::Index> bounds = run_bounds(trajectory);
  double longest = 1.0;
  for (Eigen::Index j = 0; j < residuals.cols(); ++j) {
    const Eigen::VectorXd e = residuals.col(j);
    const double power = e.squaredNorm();
    if (!(power > 0.0)) continue;
    double time = 1.0;
    for (Eigen::Index lag = 1; lag < residuals.rows() / 4; ++lag) {
      const double correlation = lagged_product(e, bounds, lag) / power;
      if (correlation <= 0.0) break;
      time += 2.0 * correlation;
    }
    longest = std::max(longest, time);
  }
  return longest;
}

std::vector<Block> make_blocks(const Eigen::VectorXi& trajectory, double rows, int fewest) {
  const double longest = std::max(1.0, std::floor(static_cast<double>(trajectory.size()) / fewest));
  const double wanted = std::clamp(rows, 1.0, longest);
  const std::vector<Eigen::Index> bounds = run_bounds(trajectory);
  std::vector<Block> blocks;
  for (std::size_t r = 0; r + 1 < bounds.size(); ++r) {
    const Eigen::Index length = bounds[r + 1] - bounds[r];
    const auto count = std::max<Eigen::Index>(
        1, static_cast<Eigen::Index>(std::lround(static_cast<double>(length) / wanted)));
    for (Eigen::Index b = 0; b < count; ++b) {
      const Eigen::Index first = bounds[r] + length * b / count;
      blocks.push_back({first, bounds[r] + length * (b + 1) / count - first});
    }
  }
  return blocks;
}

Eigen::MatrixXd jackknife_covariance(const StackedSystem& system, const WeightedFit& fit,
                                     double ridge, const std::vector<Block>& blocks) {
  const Eigen::Index p = system.parameters;
  const Eigen::MatrixXd score = fit.final_weights.cwiseProduct(fit.residuals);
  const Eigen::MatrixXd whole = gram(system, fit.curvature, 0, system.torque.rows());
  Eigen::MatrixXd moved(p, static_cast<Eigen::Index>(blocks.size()));
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const auto [first, rows] = blocks[b];
    const ScaledSolver without(whole - gram(system, fit.curvature, first, rows), ridge);
    moved.col(static_cast<Eigen::Index>(b)) = without.solve(gradient(system, score, first, rows));
  }
  const Eigen::VectorXd mean = moved.rowwise().mean();
  moved.colwise() -= mean;
  const auto count = static_cast<double>(blocks.size());
  return (count - 1.0) / count * (moved * moved.transpose());
}

}  // namespace kinescope::identify
