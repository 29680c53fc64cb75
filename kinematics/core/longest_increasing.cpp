// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/longest_increasing.h"

#include <algorithm>
#include <iterator>

namespace kinescope {

std::vector<Eigen::Index> longest_increasing(const std::vector<double>& values) {
  std::vector<std::size_t> ends;  // of the best sequence of each length
  std::vector<std::size_t> before(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto place =
        std::ranges::lower_bound(ends, values[i], {}, [&](std::size_t end) { return values[end]; });
    before[i] = place == ends.begin() ? i : *std::prev(place);
    if (place == ends.end()) {
      ends.push_back(i);
    } else if (values[i] < values[*place]) {  // of two alike the first stays
      *place = i;
    }
  }
  std::vector<Eigen::Index> out(ends.size());
  std::size_t at = ends.empty() ? 0 : ends.back();
  for (auto slot = out.rbegin(); slot != out.rend(); ++slot) {
    *slot = static_cast<Eigen::Index>(at);
    at = before[at];
  }
  return out;
}

}  // namespace kinescope
