// SPDX-License-Identifier: Apache-2.0
//
// What is known of a system's state: all of it, or positions alone, whose speeds are estimated. On
// line by backward differences and a low-pass of order 1, afterwards by a zero-phase Butterworth
// filter of order 2 and central differences (Amadio et al. 2021, "Model-Based Policy Search Using
// Monte Carlo Gradient Estimation with Real Systems Application", section VI).
#pragma once

#include <Eigen/Core>

namespace kinescope::policy {

enum class Sensing { kFull, kPositions };

/// Cut-offs as shares of the sampling rate, below 0.5. FIXME measured
struct SpeedFilters {
  double on_line = 0.25;
  double off_line = 0.25;
};

/// Weight w of a new value in v += w (new - v), for a cut-off given as a share of the rate:
/// the step response of the continuous filter, 1 - exp(-2 pi share).
[[nodiscard]] double low_pass_weight(double share_of_rate);

/// On line: one call a sample.
class SpeedEstimator {
 public:
  SpeedEstimator(double step_s, double share_of_rate);
  /// Positions (P) to the state (2 P); the first sample is at rest.
  [[nodiscard]] Eigen::VectorXd update(const Eigen::VectorXd& positions);

 private:
  double step_s_;
  double weight_;
  Eigen::VectorXd last_, speed_;
};

/// Afterwards: positions (rows are samples, at least two; x P) to states (x 2 P).
[[nodiscard]] Eigen::MatrixXd smoothed_states(const Eigen::MatrixXd& positions, double step_s,
                                              double share_of_rate);

}  // namespace kinescope::policy
