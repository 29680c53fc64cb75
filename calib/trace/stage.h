// SPDX-License-Identifier: Apache-2.0
//
// The model with some effects in it: fitted, summed, its held-out errors known.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "calib/trace/held_out.h"

namespace kinescope::trace {

struct Stage {
  std::vector<AddedEffect> added;
  TracedFit fit;
  NormalSystem system;  ///< refers to fit.linear
  HeldOutInstants held_out;
  HeldOutError error;

  Stage(std::vector<AddedEffect> effects, TracedFit fitted);
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  /// Sum of whitened squared errors, held out.
  [[nodiscard]] double held_out_sum() const { return held_out.whitened.sum(); }
  /// Root mean square of the residual, in its unit.
  [[nodiscard]] double rms() const;
};

using StagePtr = std::shared_ptr<const Stage>;

/// The same linear model without one of its effects: nothing else has moved.
[[nodiscard]] Linearisation without_effect(const Stage& stage, std::size_t index);

/// To first order, where one of its effects is not there and all else gives way: no refit.
[[nodiscard]] double held_out_sum_without(const Stage& stage, std::size_t index);

[[nodiscard]] StagePtr make_stage(const TracedModel& model, std::vector<AddedEffect> effects);

/// Nothing where the fit does not name it.
[[nodiscard]] const Candidate* find_candidate(const TracedFit& fit, const EffectId& id);

/// "backlash at joint2".
[[nodiscard]] std::string name_of(const EffectId& id);
/// `found`, then "backlash at joint2, coupling at joint3".
[[nodiscard]] std::string found_words(std::string_view found,
                                      const std::vector<TracedEffect>& accepted);
/// False for parameters that cannot be.
[[nodiscard]] bool is_possible(const Candidate& candidate, const Eigen::VectorXd& theta);
[[nodiscard]] bool refines(const Candidate& candidate, const EffectId& id);
[[nodiscard]] bool contains(const Candidate& candidate, const EffectId& id);

[[nodiscard]] std::vector<AddedEffect> without(std::vector<AddedEffect> effects, std::size_t index);

/// What columns do to every row, whitened: rows x columns.
[[nodiscard]] Eigen::MatrixXd rows_of(const Linearisation& linear,
                                      const std::vector<EffectColumn>& columns);
/// The linear model with more columns, and priors on them (empty: none).
[[nodiscard]] Linearisation extend(const Linearisation& linear,
                                   const std::vector<EffectColumn>& columns,
                                   const Eigen::MatrixXd& prior);
/// The same with columns given row by row, whitened.
[[nodiscard]] Linearisation extend(const Linearisation& linear, const Eigen::MatrixXd& columns,
                                   const Eigen::MatrixXd& prior);

/// p-value of the squares that `less` leaves beyond those of `with`, which has so many parameters
/// more or others, each stretch counted as one measurement only. A few large differences of squares
/// say little about their mean, and much beside what is left with it. Of single postures, which are
/// many and may be outliers, their mean says enough: 1.
[[nodiscard]] double lost_p_value(const Stage& less, const Stage& with, double parameters);

}  // namespace kinescope::trace
