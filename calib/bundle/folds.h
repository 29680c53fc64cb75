// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

namespace kinescope::bundle {

/// Splits frames into folds of unseen posture: the space of joint values is cut into boxes of equal
/// count (median cuts along the widest direction), and whole boxes are dealt out. `features`:
/// frames x values, any units. Without features the frames are cut into stretches of time. Returns
/// a fold for every frame.
[[nodiscard]] std::vector<int> assign_folds(const Eigen::MatrixXd& features, int folds);
/// The same by lot: folds of equal count, frames dealt out by a seeded shuffle.
[[nodiscard]] std::vector<int> deal_folds(std::size_t frames, int folds);

}  // namespace kinescope::bundle
