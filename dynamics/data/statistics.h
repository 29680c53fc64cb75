// SPDX-License-Identifier: Apache-2.0
//
// Order statistics and a slope, for the checks of this room.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// rad or m: standard deviation of a joint that does not move.
inline constexpr double kStillSpread = 1e-3;

/// The value below which `share` (0 to 1) of them lie; 0 of nothing.
[[nodiscard]] double quantile(std::vector<double> values, double share);
/// `part` over `whole`; 0 of nothing.
[[nodiscard]] double share_of(Eigen::Index part, Eigen::Index whole);
[[nodiscard]] std::vector<double> to_vector(const Eigen::Ref<const Eigen::VectorXd>& values);

/// y = slope x through the origin by least squares; `explained` = 1 - residual / sum of squares of
/// y.
struct Slope {
  double value = 0.0;
  double explained = 0.0;
};
[[nodiscard]] Slope slope_through_origin(const std::vector<double>& x,
                                         const std::vector<double>& y);

/// Steps between rows of one trajectory, s.
[[nodiscard]] std::vector<double> steps_of(const Eigen::VectorXd& t_s,
                                           const Eigen::VectorXi& trajectory);

}  // namespace kinescope
