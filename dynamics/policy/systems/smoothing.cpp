// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/smoothing.h"

#include "dynamics/data/zero_phase_filter.h"

namespace kinescope::policy {

Eigen::MatrixXd smoothed_states(const Eigen::MatrixXd& positions, double step_s, double cutoff_hz) {
  constexpr int kOrder = 2;
  const Eigen::MatrixXd smooth = filter_zero_phase(positions, kOrder, cutoff_hz, 1.0 / step_s);
  Eigen::MatrixXd out(positions.rows(), 2 * positions.cols());
  out << smooth, central_differences(smooth, step_s);
  return out;
}

}  // namespace kinescope::policy
