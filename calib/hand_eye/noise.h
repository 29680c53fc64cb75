// SPDX-License-Identifier: Apache-2.0
//
// Two sources of error, and how large each is: the camera's (the declared sigmas times one factor,
// of poses one for turns and one for shifts) and the controller's, whose pose of the flange errs by
// a turn and a shift in the flange's frame. A frame's rows have the covariance
//   V = camera^2 I + G diag(flange_rad^2, flange_m^2) G',   G = FrameRows::by_flange:
// what the controller errs by moves all rows of a frame together, however many corners there are.
// Internal to the room.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "calib/hand_eye/model.h"

namespace kinescope::hand_eye {

struct Noise {
  double camera = 1.0;       ///< over the declared sigmas; of poses, over those of shifts
  double camera_turn = 1.0;  ///< of poses, over those of turns
  double flange_rad = 0.0;   ///< about each axis
  double flange_m = 0.0;     ///< along each axis
  /// Of a perturbation of T_base_flange.
  [[nodiscard]] Matrix6d flange_covariance() const;
};

/// 1 over the camera's noise, of every row of a frame.
[[nodiscard]] Eigen::VectorXd camera_weights(const Noise& noise, const FrameRows& rows);

/// V^-1/2 of a frame, by the six directions in which the controller's error moves its rows.
class Whitening {
 public:
  Whitening(const Noise& noise, const FrameRows& rows);
  [[nodiscard]] Eigen::MatrixXd apply(const Eigen::MatrixXd& rows) const;
  [[nodiscard]] double log_determinant() const { return log_determinant_; }  ///< of V

 private:
  Eigen::VectorXd weights_;  // of rows
  Eigen::MatrixXd Q_;        // rows x 6 at most
  Eigen::MatrixXd inner_;    // what takes the place of I there, less that
  double log_determinant_ = 0.0;
};

/// Medians over the frames of what each says by itself: a start that a few wrong frames do not
/// spoil.
[[nodiscard]] Noise robust_noise(const std::vector<FrameRows>& frames);

/// Restricted maximum likelihood (Patterson and Thompson 1971) of all by Fisher scoring, from
/// a start; the parameters' freedom is allowed for.
[[nodiscard]] Noise estimate_noise(const std::vector<FrameRows>& frames, const Noise& start);

/// A frame's own estimate of the controller's error (right perturbation of T_base_flange that the
/// rows ask for) and its covariance.
struct FlangeError {
  Vector6d error;
  Matrix6d covariance;                                    ///< by both sources of noise
  Eigen::Matrix<double, 6, Eigen::Dynamic> by_parameter;  ///< d error / d parameter
};
[[nodiscard]] FlangeError flange_error(const FrameRows& rows, const Noise& noise);

}  // namespace kinescope::hand_eye
