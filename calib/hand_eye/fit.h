// SPDX-License-Identifier: Apache-2.0
//
// One hypothesis fitted: solve, weigh, leave out the rows that contradict all others, again.
// Internal to the room.
#pragma once

#include <optional>
#include <vector>

#include "calib/hand_eye/solve.h"

namespace kinescope::hand_eye {

struct Fit {
  State state;
  Noise noise;
  bool converged = false;
  std::vector<std::optional<FrameRows>> rows;  ///< of every frame, at the state
  std::vector<std::size_t> used;               ///< frames, ascending
  Eigen::MatrixXd information;                 ///< of the used frames, parameters x parameters
};

/// `reject_sigma`: a frame whose flange is off by more than a normal number so far out is left out,
/// unless many are, or all up to an end of the recording (something moved then).
[[nodiscard]] Fit fit(const Model& model, const State& start, double reject_sigma);

/// Whitened residual and Jacobian of a frame.
struct WhiteRows {
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
  double log_determinant = 0.0;  ///< of the rows' covariance
};
[[nodiscard]] WhiteRows white(const FrameRows& rows, const Noise& noise);

/// Inverse of an information matrix; nothing where a direction is not seen.
[[nodiscard]] std::optional<Eigen::MatrixXd> covariance_of(const Eigen::MatrixXd& information);

/// Covariance of the fitted parameters. Of a motion widened for residuals that are alike over time:
/// a sandwich over stretches (White 1980; Cameron and Miller 2015).
[[nodiscard]] std::optional<Eigen::MatrixXd> covariance_of(const Model& model, const Fit& fit);

/// Integral time of the autocorrelation of the used frames' whitened residuals, s; 0 for postures.
[[nodiscard]] double correlation_time(const Model& model, const Fit& fit);

}  // namespace kinescope::hand_eye
