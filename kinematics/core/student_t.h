// SPDX-License-Identifier: Apache-2.0
//
// Takes   squared lengths of residual vectors.
// Gives   the scale under which Student's t makes them the most probable, and how probable.
// Method  expectation-maximisation (Lange, Little and Taylor, JASA 1989): outliers cost little and
//         bounded surprise.
#pragma once

#include <span>

namespace kinescope {

struct StudentT {
  double scale_squared = 0.0;  ///< of one coordinate
  double deviance = 0.0;       ///< -2 ln of the likelihood of all vectors
};

/// Of vectors with `coordinates` entries each, in the unit of `squares`. Residuals without noise
/// would be infinitely probable: the scale squared is not taken below `least_scale_squared` (> 0).
/// Of nothing: zeros. O(n) a step, at most 200 steps.
[[nodiscard]] StudentT fit_student_t(std::span<const double> squares, double coordinates,
                                     double least_scale_squared);

/// What a vector counts as in a weighted sum of squares: the expectation under that scale.
[[nodiscard]] double student_weight(double square, double coordinates, double scale_squared);

}  // namespace kinescope
