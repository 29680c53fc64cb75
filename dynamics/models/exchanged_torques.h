// SPDX-License-Identifier: Apache-2.0
//
// Two torque columns that stand in each other's place: either joint's torque is then explained by
// nothing, and as the other's both are.
#pragma once

#include <optional>

#include "dynamics/data/torque_samples.h"
#include "dynamics/identify/identify.h"

namespace kinescope {

struct ExchangedTorques {
  int first = 0;  ///< joints, in the order of the samples' columns
  int second = 0;
  Eigen::VectorXd as_logged_percent;  ///< nMSE on motion left out of the fit, one a joint
  Eigen::VectorXd exchanged_percent;  ///< the same with the two columns exchanged
};

/// The samples with the torques of two joints exchanged.
[[nodiscard]] TorqueSamples with_exchanged_torques(TorqueSamples samples, int first, int second);

/// The pair whose exchange explains both torques; nothing where no exchange does. Only joints that
/// are explained badly (`left_out_percent`: one a joint, constant_joints.h) are looked at: with n
/// of them n (n - 1) / 2 identifications in `folds` folds, on at most 2000 samples.
[[nodiscard]] std::optional<ExchangedTorques> find_exchanged_torques(
    const DynamicModel& model, const TorqueSamples& samples,
    const Eigen::VectorXd& left_out_percent, const IdentifyOptions& options, int folds);

}  // namespace kinescope
