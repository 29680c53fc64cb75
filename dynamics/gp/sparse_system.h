// SPDX-License-Identifier: Apache-2.0
//
// Inducing points as features phi(x) = L^-1 k(z, x) with K_zz = L L'; internal.
#pragma once

#include <optional>

#include "dynamics/gp/feature_system.h"
#include "dynamics/gp/gram.h"

namespace kinescope::gp {

struct SparseSystem {
  Covariance covariance;
  Prepared inducing;
  Eigen::MatrixXd factor;  ///< L
  double jitter = 0.0;     ///< added to the diagonal of K_zz
  FeatureSystem pressed;
  FeatureSolution solution;
  Eigen::VectorXd log_noise;
  double lost = 0.0;   ///< sum over samples of (k_ii - q_ii) / noise_i
  double bound = 0.0;  ///< on the log marginal likelihood

  [[nodiscard]] Eigen::Index count() const { return factor.rows(); }
  /// phi' of some samples: samples x m.
  void features(const Prepared& at, Eigen::Index begin, Scratch& scratch, Block out) const;
};

/// Nothing where K_zz has no factor within `max_jitter` (relative).
[[nodiscard]] std::optional<SparseSystem> make_sparse_system(Workers& workers, const Kernel& kernel,
                                                             const Eigen::VectorXd& log_noise,
                                                             const Problem& problem,
                                                             const Eigen::MatrixXd& inducing,
                                                             double max_jitter);

}  // namespace kinescope::gp
