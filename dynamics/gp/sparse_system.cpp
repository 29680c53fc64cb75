// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/sparse_system.h"

#include <algorithm>
#include <cmath>

#include "dynamics/gp/tiled_cholesky.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

bool factorise(Workers& workers, const Covariance& covariance, const Prepared& inducing,
               double max_jitter, Eigen::MatrixXd& factor, double& jitter) {
  double relative = 1e-14;
  while (relative <= max_jitter) {
    factor = covariance.lower(workers, inducing);
    jitter = relative * factor.diagonal().mean();
    factor.diagonal().array() += jitter;
    if (!factor.diagonal().allFinite()) return false;
    if (tiled_cholesky(workers, factor) == 0) return true;
    relative *= 10.0;
  }
  return false;
}

void press_samples(Workers& workers, const Problem& problem, SparseSystem& system) {
  const Index m = system.count();
  const Prepared at = system.covariance.prepare(problem.inputs);
  const Eigen::VectorXd prior = system.covariance.diagonal(workers, at);
  const Eigen::VectorXd noise = noise_of_rows(problem, system.log_noise);
  const Index chunk = rows_per_qr(m);
  const Index chunks = (problem.samples + chunk - 1) / chunk;
  std::vector<Eigen::MatrixXd> parts(static_cast<std::size_t>(chunks));
  std::vector<double> lost(static_cast<std::size_t>(chunks));
  workers.run(chunks, [&](Index task, Scratch& scratch) {
    const Index begin = task * chunk;
    const Index size = std::min(chunk, problem.samples - begin);
    Eigen::MatrixXd rows(size, m + 1);
    system.features(at, begin, scratch, rows.leftCols(m));
    lost[static_cast<std::size_t>(task)] =
        ((prior.segment(begin, size) - rows.leftCols(m).rowwise().squaredNorm()).cwiseMax(0.0))
            .cwiseQuotient(noise.segment(begin, size))
            .sum();
    rows.col(m) = problem.targets.segment(begin, size);
    rows = problem.noise_scale.segment(begin, size).cwiseSqrt().cwiseInverse().asDiagonal() * rows;
    Eigen::MatrixXd triangle = Eigen::MatrixXd::Zero(m + 1, m + 1);
    absorb_rows(triangle, rows);
    parts[static_cast<std::size_t>(task)] = std::move(triangle);
  });
  PressedOutput pressed{Eigen::MatrixXd::Zero(m + 1, m + 1), problem.samples,
                        problem.noise_scale.array().log().sum()};
  for (std::size_t c = 0; c < parts.size(); ++c) {
    absorb_rows(pressed.triangle, parts[c]);
    system.lost += lost[c];
  }
  system.pressed.outputs = {std::move(pressed)};
  system.pressed.exponents.resize(m, 0);
}

}  // namespace

void SparseSystem::features(const Prepared& at, Index begin, Scratch& scratch, Block out) const {
  const Index width = covariance.tile_samples();
  for (Index row = 0; row < out.rows(); row += width) {
    const Index rows = std::min(width, out.rows() - row);
    for (Index col = 0; col < count(); col += width) {
      const Index cols = std::min(width, count() - col);
      covariance.tile({at, begin + row, rows}, {inducing, col, cols}, scratch,
                      out.block(row, col, rows, cols));
    }
  }
  solve_lower_transposed_right(factor, out);
}

std::optional<SparseSystem> make_sparse_system(Workers& workers, const Kernel& kernel,
                                               const Eigen::VectorXd& log_noise,
                                               const Problem& problem,
                                               const Eigen::MatrixXd& inducing, double max_jitter) {
  SparseSystem out{Covariance(kernel), {}, {}, 0.0, {}, {}, log_noise, 0.0, 0.0};
  out.inducing = out.covariance.prepare(inducing);
  if (!factorise(workers, out.covariance, out.inducing, max_jitter, out.factor, out.jitter)) {
    return std::nullopt;
  }
  press_samples(workers, problem, out);
  out.solution = solve(out.pressed, Eigen::VectorXd(), log_noise);
  // Titsias 2009, eq. 9.
  out.bound = out.solution.log_likelihood - 0.5 * out.lost;
  return out;
}

}  // namespace kinescope::gp
