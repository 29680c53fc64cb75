// SPDX-License-Identifier: Apache-2.0
//
// How smooth and how large a Gaussian process is beside a linear model.
#pragma once

#include <limits>
#include <vector>

#include <Eigen/Core>

namespace kinescope::trace {

/// A process of one smoothness, in coordinates in which prior and data are both diagonal.
struct Smoothness {
  double length = 0.0;
  Eigen::VectorXd shown;       ///< data: information of each coordinate; prior variance 1
  Eigen::VectorXd score;       ///< what the data say of each
  Eigen::MatrixXd directions;  ///< nodes' values of each; empty where nobody asks for them
};

struct SmoothnessChoice {
  const Smoothness* smoothness = nullptr;
  double variance = 0.0;
  /// Over that of no process at all.
  double log_evidence = -std::numeric_limits<double>::infinity();
};

/// The likeliest smoothness and variance where a whitened row has this noise; variances are looked
/// for from a thousandth to 1e9 times their natural scale, `decades` apart. Rasmussen and Williams
/// 2006, eq. 2.30.
[[nodiscard]] SmoothnessChoice likeliest_smoothness(const std::vector<Smoothness>& all,
                                                    double noise, double decades);

/// Posterior mean in the coordinates of the choice.
[[nodiscard]] Eigen::VectorXd mean_of(const SmoothnessChoice& choice, double noise);

/// Variance of a whitened row beside the process, which was fitted at `noise`. `whole`: squares
/// without it; `freedom`: rows beyond the model's own parameters.
[[nodiscard]] double noise_beside(const SmoothnessChoice& choice, double noise, double whole,
                                  double freedom);

}  // namespace kinescope::trace
