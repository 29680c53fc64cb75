// SPDX-License-Identifier: Apache-2.0
//
// What a first-order low-pass of a drive makes of a torque: constant dy/dt + y = x.
#pragma once

#include <Eigen/Core>

namespace kinescope {

/// Each column of `values` (rows x signals, any unit) behind a low-pass with this time constant, s;
/// 0 or less: as it is. Rows are `time_s` of `trajectory`; a cubic through four rows is integrated
/// exactly from one to the next, so that four rows a period of the fastest part are enough. Where a
/// trajectory begins, or rows are missing, what was before is the odd reflection about the first
/// row. O(rows x signals).
[[nodiscard]] Eigen::MatrixXd first_order_lag(const Eigen::MatrixXd& values,
                                              const Eigen::VectorXd& time_s,
                                              const Eigen::VectorXi& trajectory, double constant_s);

}  // namespace kinescope
