// SPDX-License-Identifier: Apache-2.0
//
// Inertial parameters by ten free numbers, every choice of which is a body that can exist: the
// pseudo-inertia is U U' with U = e^a [e^d1 s12 s13 t1; 0 e^d2 s23 t2; 0 0 e^d3 t3; 0 0 0 1].
// Rucker and Wensing 2022, eq. 16.
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "kinematics/model/inertial_parameters.h"

namespace kinescope::identify {

/// Order: a, d1, d2, d3, s12, s23, s13, t1, t2, t3.
using LogCholesky = Vector10d;

template <typename Scalar>
using UpperFactor = Eigen::Matrix<Scalar, 4, 4>;

/// False for numbers that no robot has (a factor of e^30): a solver's step that went too far.
template <typename Scalar>
[[nodiscard]] bool in_range(const Scalar* theta) {
  for (int k = 0; k < 4; ++k) {
    if (!(theta[k] < 30.0) || !(theta[k] > -30.0)) return false;
  }
  return true;
}

template <typename Scalar>
[[nodiscard]] UpperFactor<Scalar> upper_factor(const Scalar* theta) {
  using std::exp;
  UpperFactor<Scalar> U = UpperFactor<Scalar>::Zero();
  U(0, 0) = exp(theta[1]);
  U(1, 1) = exp(theta[2]);
  U(2, 2) = exp(theta[3]);
  U(0, 1) = theta[4];
  U(1, 2) = theta[5];
  U(0, 2) = theta[6];
  U(0, 3) = theta[7];
  U(1, 3) = theta[8];
  U(2, 3) = theta[9];
  U(3, 3) = Scalar(1.0);
  return exp(theta[0]) * U;
}

/// In the order of InertialParameters::vector().
template <typename Scalar>
[[nodiscard]] Eigen::Matrix<Scalar, 10, 1> inertial_vector(const Scalar* theta) {
  const UpperFactor<Scalar> U = upper_factor(theta);
  const UpperFactor<Scalar> J = U * U.transpose();
  Eigen::Matrix<Scalar, 10, 1> out;
  out << J(3, 3), J(0, 3), J(1, 3), J(2, 3), J(1, 1) + J(2, 2), -J(0, 1), -J(0, 2),
      J(0, 0) + J(2, 2), -J(1, 2), J(0, 0) + J(1, 1);
  return out;
}

/// Of parameters whose pseudo-inertia is positive definite; throws std::logic_error for others.
[[nodiscard]] LogCholesky log_cholesky(const InertialParameters& parameters);

}  // namespace kinescope::identify
