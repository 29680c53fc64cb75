// SPDX-License-Identifier: Apache-2.0
//
// Takes   GpModel of one output, a Dataset too large for its kernel matrix, inducing inputs.
// Gives   FittedGp, as from fit(): predict() and Predictor work the same.
// Method  variational inducing points (Titsias 2009): the evidence bound; the samples
//         pass once through a QR in chunks, so memory is that of m x m matrices. Inducing
//         inputs by greedy conditional variance (Burt, Rasmussen and van der Wilk 2020).
// Not here: several outputs; leave_out().
#pragma once

#include <cstdint>

#include "dynamics/gp/hyperparameters.h"

namespace kinescope::gp {

struct InducingOptions {
  Eigen::Index count = 500;
  /// The greedy choice looks at so many samples, drawn by a seeded hash of their values: shuffling
  /// the samples changes nothing.
  Eigen::Index candidates = 5000;
  std::uint64_t seed = 1;
  /// No further point where the variance left is below this share of the largest prior variance.
  double relative_tolerance = 1e-8;
};

/// Inputs (inducing x columns, not normalised) where the kernel's variance given the ones before
/// was the largest.
[[nodiscard]] Eigen::MatrixXd choose_inducing(const GpModel& model, const Dataset& dataset,
                                              const InducingOptions& options = {});

/// log_likelihood of the result is the lower bound.
[[nodiscard]] FittedGp fit_sparse(const GpModel& model, const Dataset& dataset,
                                  const Eigen::MatrixXd& inducing, const FitOptions& options = {});

}  // namespace kinescope::gp
