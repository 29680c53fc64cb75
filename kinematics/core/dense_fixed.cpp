// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/dense_algebra.h"

namespace kinescope {

Vector6d solve_symmetric(const Matrix6d& matrix, const Vector6d& right) {
  return matrix.ldlt().solve(right);
}

Eigen::Vector3d solve_symmetric(const Eigen::Matrix3d& matrix, const Eigen::Vector3d& right) {
  return matrix.ldlt().solve(right);
}

std::optional<Matrix6d> inverse_of_positive(const Matrix6d& matrix) {
  const Eigen::LDLT<Matrix6d> factor(matrix);
  if (!factor.isPositive()) return std::nullopt;
  return factor.solve(Matrix6d::Identity());
}

}  // namespace kinescope
