// SPDX-License-Identifier: Apache-2.0
//
// Torques of an identified robot, and how far they are from measured ones.
#pragma once

#include "dynamics/identify/identify.h"

namespace kinescope {

/// Samples x joints, in the unit of the torques that were identified.
struct TorquePrediction {
  Eigen::MatrixXd mean;
  Eigen::MatrixXd
      model_sigma;        ///< from the parameters' covariance; infinite where they are undetermined
  Eigen::MatrixXd sigma;  ///< of a new measurement: with the joint's noise
};

[[nodiscard]] TorquePrediction predict_torque(const Identification& identification,
                                              const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                              const Eigen::MatrixXd& ddq);

/// The mean only, for other values of the parameters (those of a consistent model).
[[nodiscard]] Eigen::MatrixXd predict_torque_mean(const Identification& identification,
                                                  const Eigen::VectorXd& parameters,
                                                  const Eigen::MatrixXd& q,
                                                  const Eigen::MatrixXd& dq,
                                                  const Eigen::MatrixXd& ddq);

/// nMSE of each column: mean squared error over the variance of the measured values, per cent.
/// Entries of weight 0 do not count; `weights` empty is 1 everywhere. NaN where the measured
/// values are constant.
[[nodiscard]] Eigen::VectorXd normalised_error_percent(const Eigen::MatrixXd& measured,
                                                       const Eigen::MatrixXd& predicted,
                                                       const Eigen::MatrixXd& weights = {});

}  // namespace kinescope
