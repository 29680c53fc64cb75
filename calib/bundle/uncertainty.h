// SPDX-License-Identifier: Apache-2.0
//
// What the data say about each parameter, and what they do not say.
#pragma once

#include <string>
#include <vector>

#include "calib/bundle/problem.h"

namespace kinescope::bundle {

struct Uncertainty {
  /// The global ones but for corrections that bear on a few frames each, in the order of the rows
  /// below.
  std::vector<FreeBlock> blocks;
  std::vector<Parameter> parameters;  ///< names, units, sigmas; values are left to the caller
  Eigen::MatrixXd covariance;         ///< widened for noise that is correlated in time
  Observability observability;
  double correlation_time_s = 0.0;  ///< integral time of the residuals' autocorrelation
  /// Variances over those of independent noise, mean over the parameters; markers at rest, whose
  /// noise is one error in all frames, not counted in.
  double noise_widening = 1.0;
  double chi_square = 0.0;
  int rows = 0;
};

/// Covariance of the global parameters at a solution: inverse of J'J (joint values per frame
/// eliminated, priors included), then widened by a block-wise sandwich (White 1980; Cameron and
/// Miller 2015) over stretches of time longer than the residuals' correlation (postures: one
/// stretch each). A nominal robot's choice of frames is held first (gauge.h): it is no ignorance.
[[nodiscard]] Uncertainty estimate_uncertainty(const Spec& spec, State& state,
                                               const std::vector<int>& used);

}  // namespace kinescope::bundle
