// SPDX-License-Identifier: Apache-2.0
//
// The maximum of a function that rises and then falls.
#pragma once

#include <functional>

namespace kinescope {

struct Maximum {
  double at = 0.0;
  double value = 0.0;
};

/// Kiefer 1953: each of `steps` narrows [low, high] to 0.618 of its width by one evaluation.
[[nodiscard]] Maximum golden_section(const std::function<double(double)>& function, double low,
                                     double high, int steps);

}  // namespace kinescope
