// SPDX-License-Identifier: Apache-2.0
//
// Takes   a TracedModel: residual, Jacobian, candidate effects, a fit.
// Gives   Trace: the effects that the model lacked, what cannot be told apart, what is left, with
//         the error before and after on data that no fit has seen.
// Units   the model's; sizes in the unit each effect states.
// Method  score test of every candidate against the model's own freedom (Rao 1948), covariances by
//         stretches of time (Cameron and Miller 2015); forward selection at a false-alarm rate over
//         the whole family (Holm 1979), refits, judgement on held-out instants, backward check.
// Not here: what the effects are (calib/effects, dynamics/effects), cameras, robots.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/trace/trace_result.h"
#include "kinematics/core/progress.h"

namespace kinescope {

struct TraceOptions {
  double false_alarm_rate = 0.01;  ///< of finding anything at all in a recording without effects
  int max_effects = 12;
  int refits = 3;  ///< candidates refitted in full before one is chosen
  /// Fits after which nothing more is looked for: what is left then has none of the known shapes,
  /// and many of them stand in for it. 0: no limit.
  int most_fits = 0;
  /// Effects that move the prediction by less than this (over the rows that they touch, in the
  /// residual's unit) are below what the sensor itself gets wrong and are not looked for.
  double floor = 0.0;
  /// The same as a share of every row's own noise, where one floor does not suit all rows (torques
  /// of large joints and of small ones).
  double noise_floor = 0.0;
  /// Effects that the model has already: they stay if they earn their place.
  std::vector<AddedEffect> start = {};
  /// Of `start`, what is asked about: where it is taken out, the search ends without an answer.
  std::optional<EffectId> about = {};
  /// Asked with all that the model has then, whenever an effect was added: where it is true, the
  /// search ends without an answer.
  std::function<bool(const std::vector<AddedEffect>&)> until = {};
  /// So many effects without a scan may together name what is left at one place, judged among
  /// themselves: that something is left there has been shown. 0: none.
  int plain_causes = 0;
  int fewest_stretches = 12;               ///< of time; with fewer nothing is said
  std::string found = "the model lacked";  ///< before the names of what was found, in words
};

/// Throws nothing: where nothing can be said the verdict and the reason say why.
[[nodiscard]] Trace trace_effects(const TracedModel& model, const TraceOptions& options = {},
                                  const Progress& progress = {});

/// The effect that the search adds first beside TraceOptions::start; none where none is shown by
/// itself.
[[nodiscard]] std::optional<AddedEffect> first_effect(const TracedModel& model,
                                                      const TraceOptions& options = {});

/// Sizes, intervals and scans of the effects that `found` has, none of them a curve, as `model`
/// has them: the same measurements judged again. What was found, and what it explains, stays.
void size_again(const TracedModel& model, Trace& found);

}  // namespace kinescope
