// SPDX-License-Identifier: Apache-2.0
//
// Robust size of whitened residuals and the likelihood that goes with it.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "kinematics/core/pose.h"

namespace kinescope::structure_search {

/// Whitened residuals of all samples, split along and across the joint.
struct ResidualParts {
  bool split = false;      ///< true: along has 1 degree of freedom, across 5; false: across has 6
  bool free_axis = false;  ///< the coordinate is fitted to each sample: along is 0
  std::vector<double> along;    ///< signed
  std::vector<double> across;   ///< squared length
  std::vector<double> lever;    ///< whitened length of the axis: 1 / sigma of the coordinate
  std::vector<double> penalty;  ///< chi-square of having taken the other branch
};

/// Variances over the declared ones (at least 1 but for raw_across) and -2 ln likelihood with them.
struct ResidualScale {
  double along = 1.0;
  double across = 1.0;
  double raw_across = 1.0;
  double cost = 0.0;
};

/// Medians of chi-square with 5 and 6 degrees of freedom.
inline constexpr double kMedian5 = 4.3515;
inline constexpr double kMedian6 = 5.3481;
/// Samples beyond this many squared robust sigmas do not enter a second, efficient estimate.
inline constexpr double kTrim = 25.0;

/// A sample that costs more than this is an outlier (a flip; as likely as a 1 in 10^6 residual).
inline constexpr double kOutlierCost = 30.0;

/// What a sample costs. Were all outliers alike, a joint that moves for a while only would be as
/// well at rest as on an axis that sensors show with errors: they cost by their size, half of what
/// a variance of their own would (6 ln), since flips of poses are all far off. Chosen: at 6 one in
/// eight of robots with 20 % of flips came out wrong (`structure_grid`).
[[nodiscard]] inline double tailed_cost(double squared) {
  constexpr double kSlope = 3.0;
  return squared <= kOutlierCost ? squared
                                 : kOutlierCost + kSlope * std::log(squared / kOutlierCost);
}

/// Cost = sum_i tailed_cost(across_i / s2 + along_i^2 / a2 + penalty_i) + dof ln s2 + ln a2 per
/// sample. With `most_cost` at most that a sample, of a free axis at most kOutlierCost: a
/// coordinate that is free follows outliers.
[[nodiscard]] ResidualScale residual_scale(const ResidualParts& parts,
                                           std::optional<double> most_cost = {});

/// Weight of every sample: 1 near zero, redescending to 0 (Geman and McClure).
[[nodiscard]] std::vector<double> robust_weights(const ResidualParts& parts,
                                                 const ResidualScale& scale);

/// 1 + 2 sum of the autocorrelations until they vanish, mean over the components; at least 1.
[[nodiscard]] double integrated_autocorrelation(const std::vector<Vector6d>& residuals);

}  // namespace kinescope::structure_search
