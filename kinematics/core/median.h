// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace kinescope {

/// The middle one; of an even number the upper of the two in the middle; 0 of nothing. O(n).
[[nodiscard]] inline double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Standard deviation of normal noise over the median of its absolute values.
inline constexpr double kSigmaOverMedian = 1.4826;

}  // namespace kinescope
