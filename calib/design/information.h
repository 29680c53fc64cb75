// SPDX-License-Identifier: Apache-2.0
//
// Takes   a finished calibration; the Jacobian of a recording that is yet to be made.
// Gives   information matrices of one list of parameters, which add; the covariance of their sum.
// Method  the recordings are independent: the information of both is the sum (Fedorov 1972, section
//         1.1). What the earlier fit's claims were widened by for noise that is correlated in time
//         the new rows are widened by, too.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "calib/bundle/expected_rows.h"

namespace kinescope::design {

/// What the calibration knows of `parameters`, by its covariance (P x P). Parameters that it lacks,
/// or that it does not determine, are known to a metre, a radian, a second: as good as unknown, and
/// the sum has an inverse.
[[nodiscard]] Eigen::MatrixXd known_information(const Calibration& calibration,
                                                const std::vector<Parameter>& parameters);

/// J'J, less by Calibration::noise_widening.
[[nodiscard]] Eigen::MatrixXd information_of(const Eigen::MatrixXd& J, double widening);

/// Inverse of an information matrix, scaled first: units differ by many powers of ten. Throws
/// std::logic_error where it is not positive definite.
[[nodiscard]] Eigen::MatrixXd covariance_of(const Eigen::MatrixXd& information);

/// trace(root' information^-1 root): the summed variance of the linear functions in the columns of
/// `root` (P x r). Infinite where the matrix is not positive definite.
[[nodiscard]] double variance_of(const Eigen::MatrixXd& information, const Eigen::MatrixXd& root);

}  // namespace kinescope::design
