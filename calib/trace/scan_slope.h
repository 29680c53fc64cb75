// SPDX-License-Identifier: Apache-2.0
//
// Where the scan of an effect is continuous (a period, a time constant, a gap), the prediction has
// a slope along it, as along any parameter of the model.
#pragma once

#include <optional>
#include <vector>

#include "calib/trace/stage.h"

namespace kinescope::trace {

/// True for scans of any value between those listed.
[[nodiscard]] bool is_continuous(const Candidate& candidate);

/// d predicted / d scan of an added effect as it is fitted: rows, whitened. Nothing where the scan
/// is not continuous.
[[nodiscard]] std::optional<Eigen::VectorXd> scan_slope(const Stage& stage, std::size_t index);

/// A Gauss-Newton step of the scan, the model's own parameters following; in the unit of the scan.
struct ScanStep {
  double step = 0.0;
  double sigma = 0.0;  ///< standard deviation of the scan, noise taken as white
};

/// Nothing where the scan does not show.
[[nodiscard]] std::optional<ScanStep> scan_step(const NormalSystem& system,
                                                const Eigen::VectorXd& slope);

/// Jackknife covariance of the last `count` parameters, those of the added effects, with what is
/// not known of their scans.
[[nodiscard]] Eigen::MatrixXd effect_covariance(const Stage& stage, Eigen::Index count);

}  // namespace kinescope::trace
