// SPDX-License-Identifier: Apache-2.0
//
// Takes   explanations of one evidence.
// Gives   whether one is of one piece, and which of two is the more probable one.
// Method  the predictive score of frames that no fit has seen (calib/quality/predictive_score.h),
//         with the log odds of the structure search; among equals the more parsimonious one.
#pragma once

#include <vector>

#include "app/explain/explain.h"

namespace kinescope {

[[nodiscard]] bool is_converged(const Calibration& of);

/// The structure is determined, without doubts of the model, and every axis is known.
[[nodiscard]] bool is_structure_clear(const Explanation& of);

/// Certain of itself, and a fit of its parameters settled.
[[nodiscard]] bool is_structure_sound(const Explanation& of);

/// A fit of the whole that leaves nothing.
[[nodiscard]] bool is_explained(const Explanation& of);

/// Of one piece: nothing is in doubt, nothing is left.
[[nodiscard]] bool is_settled(const Explanation& of);

/// What was found is large beside the noise: tracks with it in them may have bent the structure,
/// however certain that was of itself.
[[nodiscard]] bool is_bent(const TracedCalibration& fitted);

/// Clearly more probable, over all measurements that there are; of two that are about as probable,
/// the one that is of one piece, or else the plainer one.
[[nodiscard]] bool is_better(const Explanation& one, const Explanation& other,
                             const Measurements& measurements);

/// Of a fitted explanation against a rival, at most 1000 either way: much for it where the rival is
/// no fit, or has a joint that its channel does not move.
[[nodiscard]] double log_odds_of(const Explanation& one, const Explanation& rival,
                                 const Measurements& measurements);

/// Which frames it had unseen together: those are what its rivals are to predict, too. Cuts of the
/// space of their own joints leave out other frames, and are worth as much as an effect (80 of log
/// odds: `undeclared`, 10097).
[[nodiscard]] std::vector<int> folds_of(const Calibration& calibration);

}  // namespace kinescope
