// SPDX-License-Identifier: Apache-2.0
//
// What one body (marker) leaves: noise differs from one instant to the next as much as it differs
// from nothing, and what lasts does not (von Neumann 1941). Beside all the others one body's rows
// are few, and may do so unseen.
#pragma once

#include <optional>

#include "calib/trace/traced_model.h"

namespace kinescope::trace {

struct LastingBody {
  int body = 0;
  /// rms of what is left over what differs between instants, rms over sqrt(2): noise makes it 1.
  double over_differences = 0.0;
  double over_noise = 0.0;  ///< rms of its whitened rows, for the model's freedom
  double rms = 0.0;         ///< in the residual's unit, as distances
};

/// The body that lasts most, where it does by both measures more than `least`. `freedom`: of all
/// rows. Nothing where rows are of no body, or instants do not follow one another.
[[nodiscard]] std::optional<LastingBody> find_lasting_body(const Linearisation& linear,
                                                           double freedom, double least);

}  // namespace kinescope::trace
