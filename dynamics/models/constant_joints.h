// SPDX-License-Identifier: Apache-2.0
//
// Takes   what a model said about motion left out of its fit (bands.h).
// Gives   the joints at which a constant would have said it better, and that constant.
// Units   those of the samples; one entry a joint.
// Not here: joints that fall back to a plainer model of their own kind (gaussian_processes.h).
#pragma once

#include <vector>

#include "dynamics/models/bands.h"

namespace kinescope {

/// Joints that get the mean torque of what was learned from, and its spread on motion left out.
struct ConstantJoints {
  std::vector<int> joints;
  Eigen::VectorXd torque;  ///< one entry of `joints` each
  Eigen::VectorXd sigma;
};

/// nMSE of each joint on motion left out, per cent; NaN where its torque does not vary.
[[nodiscard]] Eigen::VectorXd left_out_nmse_percent(const LeftOutTorques& left);

/// Joints whose residuals are above those of the mean of what was learned from: `left` then says
/// what that mean did. `torque`: of the samples learned from.
[[nodiscard]] ConstantJoints give_way_to_constant(LeftOutTorques& left,
                                                  const Eigen::MatrixXd& torque);

/// With the constants in their columns.
[[nodiscard]] TorquePrediction with_constants(TorquePrediction prediction,
                                              const ConstantJoints& constants);

}  // namespace kinescope
