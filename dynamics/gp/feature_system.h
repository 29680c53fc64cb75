// SPDX-License-Identifier: Apache-2.0
//
// Regression with finitely many features, internal. The samples are pressed once into a triangle
// by QR: with D the relative noise, [D^-1/2 Phi, D^-1/2 y] = Q [R z; 0 rho]. Nothing is lost, no
// condition number is squared, and afterwards likelihood, gradient and posterior cost d^3 whatever
// the number of samples.
#pragma once

#include "dynamics/gp/kernel_node.h"
#include "dynamics/gp/problem.h"

namespace kinescope::gp {

/// Fixed, so that the number of workers does not show.
[[nodiscard]] Eigen::Index rows_per_qr(Eigen::Index features);
/// The triangle R becomes that of [R; rows].
void absorb_rows(Eigen::MatrixXd& triangle, const Eigen::MatrixXd& rows);

/// Samples of one output, pressed.
struct PressedOutput {
  Eigen::MatrixXd triangle;      ///< d+1 x d+1: [R z; 0 rho]
  Eigen::Index count = 0;        ///< samples
  double log_noise_scale = 0.0;  ///< sum over the samples
};

struct FeatureSystem {
  std::vector<PressedOutput> outputs;
  Eigen::MatrixXd exponents;  ///< log s_f = exponents * theta

  [[nodiscard]] Eigen::Index features() const { return exponents.rows(); }
};

/// `samples`: those to use; all where it is empty.
[[nodiscard]] FeatureSystem press(Workers& workers, const KernelNode& node, const Problem& problem,
                                  const std::vector<Eigen::Index>& samples = {});
/// What pressing the samples of all of them together would give.
[[nodiscard]] FeatureSystem press_together(const std::vector<const FeatureSystem*>& parts);

/// Posterior of the weights u of scaled features: u ~ N(0, 1) before, mean `weights` and covariance
/// (U'U)^-1 after.
struct FeatureSolution {
  Eigen::VectorXd root_scale;  ///< s^1/2 of every feature
  Eigen::MatrixXd lower;       ///< U'
  Eigen::VectorXd weights;
  double log_likelihood = 0.0;
};

[[nodiscard]] FeatureSolution solve(const FeatureSystem& system, const Eigen::VectorXd& theta,
                                    const Eigen::VectorXd& log_noise);
/// d log likelihood / d (theta, log noise).
[[nodiscard]] Eigen::VectorXd likelihood_gradient(const FeatureSystem& system,
                                                  const FeatureSolution& solution,
                                                  const Eigen::VectorXd& log_noise);

}  // namespace kinescope::gp
