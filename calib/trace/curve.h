// SPDX-License-Identifier: Apache-2.0
//
// Candidates that are curves (Candidate::is_curve): how smooth and how large.
#pragma once

#include <optional>
#include <vector>

#include "calib/trace/stage.h"
#include "calib/trace/trace_result.h"

namespace kinescope::trace {

/// The length and the spread of the curve's prior that the residual of `system` makes likeliest,
/// with the noise that is left beside it; nothing where no curve is likelier than none. Rasmussen
/// and Williams 2006, eq. 2.30.
[[nodiscard]] std::optional<AddedEffect> likeliest_curve(const NormalSystem& system,
                                                         const Candidate& candidate);

/// Likeliest lengths and spreads of all curves among the stage's effects, each beside the others as
/// they are.
[[nodiscard]] std::vector<AddedEffect> tuned_curves(const Stage& stage);

/// Posterior covariance of the last `count` parameters of the model, its noise widened for its
/// memory.
[[nodiscard]] Eigen::MatrixXd posterior_covariance(const NormalSystem& system, Eigen::Index count);

/// Size, interval and band of a curve of these columns, from its picture and covariance; `t`:
/// quantile of the interval.
void size_up_curve(const std::vector<EffectColumn>& columns, double t, TracedEffect& effect);

}  // namespace kinescope::trace
