// SPDX-License-Identifier: Apache-2.0
//
// Kernel matrices of a velocity process' samples and their Cholesky factor; internal.
#pragma once

#include "dynamics/policy/velocity_model.h"

namespace kinescope::policy {

/// What the factors of a kernel are linear in: the inputs, or features of physics of them.
[[nodiscard]] Eigen::MatrixXd linear_columns(const Eigen::MatrixXd& inputs,
                                             const PhysicsFeatures* physics);

/// k(x_i, y_j), without noise.
[[nodiscard]] Eigen::MatrixXd kernel_matrix(const KernelValues& kernel, const Eigen::MatrixXd& x,
                                            const Eigen::MatrixXd& y,
                                            const PhysicsFeatures* physics);
/// k(x_i, x_i), without noise.
[[nodiscard]] Eigen::VectorXd kernel_diagonal(const KernelValues& kernel, const Eigen::MatrixXd& x,
                                              const PhysicsFeatures* physics);

struct Factor {
  Eigen::MatrixXd lower;
  double jitter = 0.0;  ///< that had to be added to the diagonal
};
/// Cholesky factor of a symmetric matrix; where there is none, with up to 1e-6 of its mean diagonal
/// added, in steps of 10 from 1e-12. Throws undetermined beyond that.
[[nodiscard]] Factor robust_cholesky(const Eigen::MatrixXd& matrix);

/// The samples (indices in rising order) that a greedy choice by posterior variance keeps: the next
/// one is where the variance given those before is largest, until its root is below `threshold`
/// times the noise's, or `most` are there.
[[nodiscard]] std::vector<Eigen::Index> informative_samples(const KernelValues& kernel,
                                                            const Eigen::MatrixXd& inputs,
                                                            const PhysicsFeatures* physics,
                                                            double threshold, Eigen::Index most);

}  // namespace kinescope::policy
