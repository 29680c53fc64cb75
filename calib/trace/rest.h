// SPDX-License-Identifier: Apache-2.0
//
// Structure that no known effect explains: where it acts, on what it depends, and a Gaussian
// process over that in place of a formula.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "calib/trace/stage.h"
#include "calib/trace/trace.h"

namespace kinescope::trace {

struct FoundRest {
  Rest rest;
  std::vector<EffectColumn> columns;  ///< of the Gaussian process: hats on its knots
  Eigen::MatrixXd rows;      ///< of a field, in place of them: what the data show of it, row by row
  Eigen::MatrixXd prior;     ///< information of either, whitened
  Eigen::VectorXd held_out;  ///< with it: whitened squared errors of every instant
};

/// The model with it.
[[nodiscard]] Linearisation extend(const Linearisation& linear, const FoundRest& found);

/// Adds what `found` explains of the residual of `system` (where it is at least a hundredth) and
/// the errors held out before and after; by how much it moves the rows that it touches is left to
/// the caller: `gain` is what it takes from the sum of squares. False where it explains less, or
/// where it does not help to predict what is held out.
[[nodiscard]] bool earns_its_place(const NormalSystem& system, FoundRest& found, double& gain);

/// The place and covariate that explain most, where that is significant at `level` over all pairs
/// of them, moves the prediction by more than the floors of `options`, makes at least a hundredth
/// of the residual's sum of squares, and helps to predict what is held out. Where there is none,
/// the phase of a vibration (vibration.h). `known`: those that are in `system`.
[[nodiscard]] std::optional<FoundRest> find_rest(const NormalSystem& system,
                                                 const std::vector<RestPlace>& places,
                                                 const std::vector<Covariate>& covariates,
                                                 const std::vector<FoundRest>& known, double level,
                                                 const TraceOptions& options);

/// The covariate over which a curve takes most from the squares that are left at a place, and how
/// much: to say where it shows, not whether it is there. nullptr: no curve takes anything.
[[nodiscard]] std::pair<const Covariate*, double> most_telling(
    const NormalSystem& system, const RestPlace& place, const std::vector<Covariate>& covariates);

}  // namespace kinescope::trace
