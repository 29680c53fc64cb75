// SPDX-License-Identifier: Apache-2.0
//
// States as models and policies see them: positions that are no angles, all speeds, then sine and
// cosine of each angle; models see the inputs after them.
#pragma once

#include <string>
#include <vector>

#include "dynamics/policy/system.h"

namespace kinescope::policy {

/// Column-major parts of matrices, rows are particles or samples.
using Block = Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
using ConstBlock = Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

/// F: the number of features of a state.
[[nodiscard]] Eigen::Index feature_count(const StateLayout& layout);
/// "cart", "cart speed", "pole speed", "sin pole", "cos pole".
[[nodiscard]] std::vector<std::string> feature_names(const StateLayout& layout);
/// features (rows x F) of states (rows x 2 P).
void state_features(const StateLayout& layout, const ConstBlock& states, Block features);
/// d_states += the pullback of d_features, given the features.
void state_features_pullback(const StateLayout& layout, const ConstBlock& features,
                             const ConstBlock& d_features, Block d_states);

}  // namespace kinescope::policy
