// SPDX-License-Identifier: Apache-2.0
//
// How much a term usually has to say: what is far below it is no motion but the rounding of a joint
// at rest.
#pragma once

#include <vector>

#include "dynamics/identify/torque_terms.h"

namespace kinescope::identify {

/// A column below this share of its usual size holds nothing about its parameter.
inline constexpr double kAtRest = 1e-6;

/// Root mean square of each term's column over random motions, all joints together.
[[nodiscard]] Eigen::VectorXd usual_sizes(const RigidModel& model, const DriveTerms& drives,
                                          const std::vector<TorqueTerm>& terms);

/// Sets the columns (one matrix a joint, samples x terms) to zero that are at rest in all joints.
void clear_columns_at_rest(const Eigen::VectorXd& usual, std::vector<Eigen::MatrixXd>& columns);

}  // namespace kinescope::identify
