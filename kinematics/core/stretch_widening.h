// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace kinescope {

/// By what the variance of sums over stretches of time falls short, where noise remembers: of a
/// length L and noise that forgets exponentially with integral time tau they have
/// 1 - tau / L (1 - exp(-L / tau)) of the variance of the long run. At least 1; 1 for tau <= 0.
[[nodiscard]] inline double stretch_widening(double length_s, double integral_time_s) {
  if (!(integral_time_s > 0.0)) return 1.0;
  const double ratio = integral_time_s / length_s;
  return 1.0 / (1.0 - ratio * (1.0 - std::exp(-1.0 / ratio)));
}

}  // namespace kinescope
