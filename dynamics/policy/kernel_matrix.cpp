// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/kernel_matrix.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "dynamics/gp/blas.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {

using Eigen::Index;

Eigen::MatrixXd linear_columns(const Eigen::MatrixXd& inputs, const PhysicsFeatures* physics) {
  if (physics == nullptr) return inputs;
  Eigen::MatrixXd out(inputs.rows(), physics->count());
  physics->evaluate(inputs, out);
  return out;
}

Eigen::MatrixXd kernel_matrix(const KernelValues& kernel, const Eigen::MatrixXd& x,
                              const Eigen::MatrixXd& y, const PhysicsFeatures* physics) {
  const auto scales = kernel.length_scales.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd xs = x * scales;
  const Eigen::MatrixXd ys = y * scales;
  Eigen::MatrixXd out(x.rows(), y.rows());
  for (Index j = 0; j < y.rows(); ++j) {
    out.col(j) = (xs.rowwise() - ys.row(j)).rowwise().squaredNorm();
  }
  out = kernel.variance * (-0.5 * out.array()).exp();
  if (kernel.factors.empty()) return out;
  const Eigen::MatrixXd lx = linear_columns(x, physics);
  const Eigen::MatrixXd ly = linear_columns(y, physics);
  Eigen::ArrayXXd product = Eigen::ArrayXXd::Ones(x.rows(), y.rows());
  for (const LinearFactor& factor : kernel.factors) {
    product *= factor.offset + (lx * factor.weights.asDiagonal() * ly.transpose()).array();
  }
  out.array() += product;
  return out;
}

Eigen::VectorXd kernel_diagonal(const KernelValues& kernel, const Eigen::MatrixXd& x,
                                const PhysicsFeatures* physics) {
  Eigen::VectorXd out = Eigen::VectorXd::Constant(x.rows(), kernel.variance);
  if (kernel.factors.empty()) return out;
  const Eigen::MatrixXd squares = linear_columns(x, physics).array().square();
  Eigen::ArrayXd product = Eigen::ArrayXd::Ones(x.rows());
  for (const LinearFactor& factor : kernel.factors) {
    product *= factor.offset + (squares * factor.weights).array();
  }
  out.array() += product;
  return out;
}

Factor robust_cholesky(const Eigen::MatrixXd& matrix) {
  constexpr double kFirst = 1e-12;
  constexpr double kLargest = 1e-6;
  const double scale = matrix.diagonal().mean();
  for (double share = 0.0; share <= kLargest * 1.5; share = share > 0.0 ? 10.0 * share : kFirst) {
    Factor out{matrix, share * scale};
    out.lower.diagonal().array() += out.jitter;
    if (gp::cholesky(out.lower) == 0 && out.lower.diagonal().allFinite()) {
      out.lower.triangularView<Eigen::StrictlyUpper>().setZero();
      return out;
    }
  }
  throw undetermined("model", "the samples' kernel matrix is singular",
                     "keep fewer samples or let the noise be larger");
}

std::vector<Index> informative_samples(const KernelValues& kernel, const Eigen::MatrixXd& inputs,
                                       const PhysicsFeatures* physics, double threshold,
                                       Index most) {
  const Index samples = inputs.rows();
  const double noise = kernel.noise_variance;
  const double enough = threshold * threshold * noise;
  Eigen::VectorXd variance = kernel_diagonal(kernel, inputs, physics);
  Eigen::MatrixXd rows(samples, std::min(samples, most));  // of the noisy matrix' pivoted factor
  std::vector<Index> kept;
  while (static_cast<Index>(kept.size()) < rows.cols()) {
    Index next = 0;
    if (!(variance.maxCoeff(&next) > enough)) break;
    const auto count = static_cast<Index>(kept.size());
    Eigen::VectorXd column = kernel_matrix(kernel, inputs, inputs.row(next), physics) -
                             rows.leftCols(count) * rows.row(next).head(count).transpose();
    column /= std::sqrt(std::max(variance[next], 0.0) + noise);
    rows.col(count) = column;
    variance -= column.cwiseAbs2();
    kept.push_back(next);
    variance[next] = -1.0;  // never again
  }
  std::ranges::sort(kept);
  return kept;
}

}  // namespace kinescope::policy
