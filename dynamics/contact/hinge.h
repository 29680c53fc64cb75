// SPDX-License-Identifier: Apache-2.0
//
// Where a flat line begins to rise: by least squares over the place of the bend.
#pragma once

#include <span>

namespace kinescope::contact {

/// The time t0 for which y = a + b max(0, t - t0), or y = a + b max(0, t - t0)^2 (a torque that
/// steps, a torque that grows), leaves the smallest residual; between the first and the last but
/// two. O(samples^2). Falls back to the first time for fewer than five samples.
[[nodiscard]] double bend_time(std::span<const double> t, std::span<const double> y);

}  // namespace kinescope::contact
