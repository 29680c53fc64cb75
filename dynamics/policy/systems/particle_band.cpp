// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/particle_band.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace kinescope::policy {
namespace {

// Of sorted values, linear between ranks.
double quantile(const std::vector<double>& sorted, double share) {
  const double rank = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(rank);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (rank - std::floor(rank)) * (sorted[above] - sorted[below]);
}

}  // namespace

ParticleBand particle_band(const ParticleRollout& rollout, Eigen::Index positions) {
  const auto rows = std::ssize(rollout.states);
  ParticleBand out{Eigen::MatrixXd(rows, positions), Eigen::MatrixXd(rows, positions),
                   Eigen::MatrixXd(rows, positions)};
  for (Eigen::Index k = 0; k < rows; ++k) {
    for (Eigen::Index p = 0; p < positions; ++p) {
      const auto column = rollout.states[static_cast<std::size_t>(k)].col(p);
      std::vector<double> values(column.begin(), column.end());
      std::ranges::sort(values);
      out.lower(k, p) = quantile(values, 0.05);
      out.median(k, p) = quantile(values, 0.5);
      out.upper(k, p) = quantile(values, 0.95);
    }
  }
  return out;
}

}  // namespace kinescope::policy
