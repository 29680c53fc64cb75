// SPDX-License-Identifier: Apache-2.0
//
// Takes   GpModel and a Dataset with outliers.
// Gives   a fit that they do not pull, and which samples it trusted how much.
// Method  Student-t noise by expectation maximisation: t = Gauss with a Gamma-distributed precision
//         (Lange, Little and Taylor 1989), each step an ordinary fit with a noise of its own for
//         every sample; or, as the baseline, the trimmed fit of the Barrett report.
#pragma once

#include "dynamics/gp/gaussian_process.h"

namespace kinescope::gp {

struct StudentOptions {
  double degrees_of_freedom = 4.0;
  int max_iterations = 50;
  double tolerance = 1e-4;     ///< largest change of a weight at which the iteration ends
  bool estimate_scale = true;  ///< the noise variance follows the weighted residuals
  FitOptions fit{};
};

struct RobustFit {
  FittedGp fitted;
  /// samples x outputs: expected relative precision of each target; near 0 for outliers.
  Eigen::MatrixXd weight;
  int iterations = 0;
  bool converged = false;
};

[[nodiscard]] RobustFit fit_student(const GpModel& model, const Dataset& dataset,
                                    const StudentOptions& options = {});

struct TrimOptions {
  double widen = 3.0;  ///< factor on all length scales in the first fit
  double share = 0.1;  ///< of the samples that are left out
  FitOptions fit{};
};

struct TrimmedFit {
  FittedGp fitted;
  std::vector<Eigen::Index> removed;  ///< ascending
};

/// A wide-bandwidth fit; the samples with the largest leave-one-out residuals (in sigmas, worst
/// output) are left out; a fit of the rest with the model's own parameters.
[[nodiscard]] TrimmedFit fit_trimmed(const GpModel& model, const Dataset& dataset,
                                     const TrimOptions& options = {});

/// All parameters whose name holds "length scale", times the factor.
[[nodiscard]] Kernel widened(const Kernel& kernel, double factor);

}  // namespace kinescope::gp
