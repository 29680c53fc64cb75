// SPDX-License-Identifier: Apache-2.0
//
// A dataset as the algebra wants it: checked, normalised, the mean removed; internal.
#pragma once

#include "dynamics/gp/gaussian_process.h"
#include "dynamics/gp/memory.h"

namespace kinescope::gp {

/// Vectors are sample-major: sample * outputs + output.
struct Problem {
  Eigen::MatrixXd inputs;
  Eigen::VectorXd targets;
  Eigen::VectorXd noise_scale;
  Eigen::Index samples = 0;
  Eigen::Index outputs = 1;

  [[nodiscard]] Eigen::Index rows() const { return samples * outputs; }
};

/// Throws bad_request that names row and column of what does not fit.
[[nodiscard]] Problem make_problem(const GpModel& model, const Dataset& dataset);

/// Noise variance of every row, given the logarithms of the model's.
[[nodiscard]] Eigen::VectorXd noise_of_rows(const Problem& problem,
                                            const Eigen::Ref<const Eigen::VectorXd>& log_noise);
/// Adds each row's share d/dlog(noise) into the noise parameter of its output.
[[nodiscard]] Eigen::VectorXd noise_gradient(const Problem& problem,
                                             const Eigen::Ref<const Eigen::VectorXd>& row_share,
                                             Eigen::Index noise_parameters);
[[nodiscard]] Eigen::VectorXd log_noise_values(const GpModel& model);

/// kDense or kFeatures.
[[nodiscard]] Route choose_route(const Kernel& kernel, const Problem& problem, Route wanted);

/// Throws bad_request when `bytes` for "what" exceed the limit (0: the memory available now); the
/// remedy names the number of inducing points or samples that would fit.
void check_memory(Eigen::Index samples, Eigen::Index outputs, double matrices,
                  std::size_t limit_bytes);

}  // namespace kinescope::gp
