// SPDX-License-Identifier: Apache-2.0
//
// What effects act through, as torques. Internal to this room.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "dynamics/effects/effect_library.h"

namespace kinescope::effects {

/// Torque joint by joint, instants each; empty where a joint has none.
using JointTorques = std::vector<Eigen::VectorXd>;

/// By carrier, for the numbers of Carriers. `slopes`: d torque / d gravity along each axis of the
/// base, instants x joints; `regressors`: of each joint, instants x 10 bodies.
[[nodiscard]] std::vector<JointTorques> carrier_torques(
    const EffectContext& context, const std::array<Eigen::MatrixXd, 3>& slopes,
    const std::vector<Eigen::MatrixXd>& regressors);

/// The same as one matrix, instants * joints x carriers; see effect_library.h for the rows.
[[nodiscard]] Eigen::SparseMatrix<double> sparse_carriers(const std::vector<JointTorques>& torques,
                                                          Eigen::Index instants);

}  // namespace kinescope::effects
