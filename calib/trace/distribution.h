// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace kinescope::trace {

/// Probability that F with (k, freedom) degrees of freedom is above `value`. Accurate to the last
/// digits also where it is tiny.
[[nodiscard]] double f_survival(double value, double k, double freedom);

/// Upper tail of a sum of `weights` (of either sign) times squares of standard normal numbers; 1 at
/// and below its mean. Saddlepoint, Kuonen 1999.
[[nodiscard]] double quadratic_form_survival(double value, const Eigen::VectorXd& weights);

/// The value that F exceeds with probability `p`.
[[nodiscard]] double f_quantile(double p, double k, double freedom);

/// The value that Student's t exceeds with probability `p` (one side), p < 1/2.
[[nodiscard]] double t_quantile(double p, double freedom);

}  // namespace kinescope::trace
