// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace kinescope {

/// s, between one stamp and the next, of two stamps or more.
[[nodiscard]] inline double mean_step_s(const std::vector<double>& times_s) {
  return (times_s.back() - times_s.front()) / static_cast<double>(times_s.size() - 1);
}

}  // namespace kinescope
