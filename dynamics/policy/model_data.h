// SPDX-License-Identifier: Apache-2.0
//
// Samples of the speeds' increments from trials; internal.
#pragma once

#include "dynamics/policy/velocity_model.h"

namespace kinescope::policy {

struct IncrementData {
  Eigen::MatrixXd inputs;      ///< samples x D
  Eigen::MatrixXd increments;  ///< samples x P, m/s or rad/s a step
};

/// From the smoothed signals. Throws bad_request where a trial does not fit the layout or is not
/// finite, undetermined where there are too few samples or a speed never changes.
[[nodiscard]] IncrementData increments_of(const StateLayout& layout,
                                          const std::vector<Trial>& trials);

}  // namespace kinescope::policy
