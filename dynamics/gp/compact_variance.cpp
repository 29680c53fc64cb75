// SPDX-License-Identifier: Apache-2.0
//
// Apart from compact.cpp: a controller that predicts links no linear algebra library.
#include "dynamics/gp/compact.h"
#include "dynamics/gp/sparse_system.h"
#include "dynamics/gp/workers.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {

using Eigen::Index;

// With Phi = K_xz L^-T and A = 1 + Phi' N^-1 Phi of one part, its variance is
// k(x, x) - k' L^-T (1 - A^-1) L^-1 k: the middle factors are averaged over the parts.
CompactVariance compact_variance(const GpModel& model, const std::vector<Dataset>& parts,
                                 const std::vector<Eigen::MatrixXd>& inputs,
                                 const Eigen::MatrixXd& inducing, const FitOptions& options) {
  KINESCOPE_CHECK(!parts.empty() && (inputs.empty() || inputs.size() == parts.size()),
                  "at least one part, and inputs of each or of none");
  Workers workers(options.threads);
  const Index size = inducing.rows();
  const Eigen::MatrixXd at = model.normalisation.normalised_inputs(inducing);
  Eigen::MatrixXd middle = Eigen::MatrixXd::Identity(size, size);
  Eigen::MatrixXd factor;
  CompactVariance out;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const auto system = make_sparse_system(workers, model.kernel, log_noise_values(model),
                                           make_problem(model, parts[p]), at, options.max_jitter);
    if (!system) {
      throw undetermined("inducing points", "their kernel matrix is not positive definite",
                         "choose fewer, or with choose_inducing()");
    }
    Eigen::MatrixXd inverse = system->solution.lower;
    inverse.triangularView<Eigen::StrictlyUpper>().setZero();
    invert_lower(inverse);
    Eigen::MatrixXd own(size, size);
    transposed_product(1.0, inverse, inverse, 0.0, own);
    middle -= own / static_cast<double>(parts.size());
    factor = system->factor;  // of the inducing inputs alone: the same for every part
    if (inputs.empty()) continue;
    const Prepared there =
        system->covariance.prepare(model.normalisation.normalised_inputs(inputs[p]));
    Eigen::VectorXd variance = system->covariance.diagonal(workers, there);
    Eigen::MatrixXd phi(there.samples, size);
    system->features(there, 0, workers.scratch(), phi);
    variance = (variance - phi.rowwise().squaredNorm()).cwiseMax(0.0).eval();
    solve_lower_transposed_right(system->solution.lower, phi);
    variance += phi.rowwise().squaredNorm();
    out.own.push_back(std::move(variance));
  }
  // root = D^1/2 V' L^-1, made a triangle.
  const SymmetricEigen eigen = symmetric_eigen(middle);
  out.root = eigen.values.cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.vectors.transpose();
  solve_lower_right(factor, out.root);
  upper_of_qr(out.root);
  out.root.triangularView<Eigen::StrictlyLower>().setZero();
  return out;
}

}  // namespace kinescope::gp
