// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/error_table.h"

#include <algorithm>

namespace kinescope {

Eigen::VectorXd ErrorTable::at(const Eigen::VectorXd& values) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(values.size());
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const auto above = std::upper_bound(value.begin(), value.end(), values[i]);
    if (above == value.begin() || above == value.end()) continue;
    const Eigen::Index right = above - value.begin();
    const double share = (values[i] - value[right - 1]) / (value[right] - value[right - 1]);
    out[i] = (1.0 - share) * error[right - 1] + share * error[right];
  }
  return out;
}

}  // namespace kinescope
