// SPDX-License-Identifier: Apache-2.0
//
// Log marginal likelihood and its gradient. Dense: one N x N matrix altogether: the inverse of the
// factor is formed in place, tiles of K^-1 are made from it when they are needed, and kernel
// values are computed again tile by tile rather than kept.
#pragma once

#include <memory>
#include <optional>

#include "dynamics/gp/gaussian_process.h"

namespace kinescope::gp {

struct Likelihood {
  double value = 0.0;
  /// By the logarithm of each parameter: kernel first, then noise.
  Eigen::VectorXd gradient;
};

enum class Score {
  kMarginalLikelihood,
  kLeaveOneOut,  ///< sum of log predictive densities, each sample left out; dense, one output
};

/// A score as a function of the parameters of one dataset. Keeps its memory between evaluations.
class Objective {
 public:
  virtual ~Objective() = default;
  /// Nothing where the kernel matrix has no Cholesky factor.
  [[nodiscard]] virtual std::optional<Likelihood> evaluate(const Eigen::VectorXd& log_values) = 0;
};

[[nodiscard]] std::unique_ptr<Objective> make_objective(const GpModel& model,
                                                        const Dataset& dataset,
                                                        const FitOptions& options = {},
                                                        Score score = Score::kMarginalLikelihood);

/// Kernel parameters, then noise.
[[nodiscard]] std::vector<Parameter> parameters_of(const GpModel& model);
[[nodiscard]] GpModel with_log_values(const GpModel& model, const Eigen::VectorXd& log_values);
[[nodiscard]] Eigen::VectorXd log_values_of(const GpModel& model);

/// Throws undetermined where the kernel matrix is singular.
[[nodiscard]] Likelihood log_marginal_likelihood(const GpModel& model, const Dataset& dataset,
                                                 const FitOptions& options = {});

}  // namespace kinescope::gp
