// SPDX-License-Identifier: Apache-2.0
//
// Is what is left noise? By its size beside the noise that the model knows apart from what it
// leaves (Linearisation::noise): tests of effects see what has a shape, this sees that something is
// there.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/trace/normal_system.h"
#include "calib/trace/trace_result.h"

namespace kinescope::trace {

/// What is left over what differs between neighbours in time. Noise, with the sensor's own errors
/// counted in, makes it 0.6 to 1.0 (`undeclared`, sample videos); what lasts is no noise.
inline constexpr double kLasts = 1.2;

/// Squares of a residual over what differs between neighbours in time, as an rms; nothing where
/// that is not known.
[[nodiscard]] std::optional<double> over_neighbours(const NormalSystem& system, double squares);

/// The residual of every place beside its noise, the most first. It lasts where it is more than
/// kLasts times as large, at `level` over all places; then with the covariate over which a curve
/// explains most of it. By medians: what happens in less than half of the recording does not
/// decide. Empty where the noise is not known.
[[nodiscard]] std::vector<LeftOver> left_over(const NormalSystem& system,
                                              const std::vector<RestPlace>& places,
                                              const std::vector<Covariate>& covariates,
                                              double level);

/// "4.2 times its noise at joint2 (61 % of it over time)" of those that last; empty of none.
[[nodiscard]] std::string lasting_words(const std::vector<LeftOver>& left);

/// Squares of the residual in the rows of a place.
[[nodiscard]] double squares_at(const Linearisation& linear, const RestPlace& place);

}  // namespace kinescope::trace
