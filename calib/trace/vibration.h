// SPDX-License-Identifier: Apache-2.0
//
// What swings at one frequency, however fast: a curve over time resolves a few turns of it only,
// and where a single body moves, nothing else tells it from errors of the sensor.
#pragma once

#include <optional>
#include <vector>

#include "calib/trace/score_test.h"

namespace kinescope::trace {

struct Vibration {
  std::size_t place = 0;  ///< of the rest places
  Covariate phase;        ///< "phase of a vibration of 3.56 Hz", rad
  Score score;            ///< of its cosine and sine
  double p_value = 1.0;   ///< over all places and frequencies
};

/// The place and frequency that explain most of the residual, where that is significant at `level`
/// and moves the prediction by the floors of `options`. Frequencies are those above what a curve
/// over time resolves and below half the rate of instants: a faster one shows at its alias. Nothing
/// for postures, and for rows of no body whose noise is not known apart. Noise of any colour is
/// none: each stretch of time has its own phase of it. Nor, for rows of no body and where it is as
/// slow as joints move, what one of the covariates swings with: that is of the motion. Fisher 1929;
/// Scargle 1982.
[[nodiscard]] std::optional<Vibration> find_vibration(const NormalSystem& system,
                                                      const std::vector<RestPlace>& places,
                                                      const std::vector<Covariate>& covariates,
                                                      double level, const TraceOptions& options);

}  // namespace kinescope::trace
