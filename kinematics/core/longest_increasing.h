// SPDX-License-Identifier: Apache-2.0
//
// The longest increasing subsequence, by patience sorting (Fredman 1975).
#pragma once

#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// Indices of the most values that increase: one stamp far ahead is left out, not all that follow
/// it. Of two alike the first stays. O(n log n).
[[nodiscard]] std::vector<Eigen::Index> longest_increasing(const std::vector<double>& values);

}  // namespace kinescope
