// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace kinescope::trace {

/// Probability that F with (k, freedom) degrees of freedom is above `value`. Accurate to the last
/// digits also where it is tiny.
[[nodiscard]] double f_survival(double value, double k, double freedom);

/// The value that F exceeds with probability `p`.
[[nodiscard]] double f_quantile(double p, double k, double freedom);

/// The value that Student's t exceeds with probability `p` (one side), p < 1/2.
[[nodiscard]] double t_quantile(double p, double freedom);

}  // namespace kinescope::trace
