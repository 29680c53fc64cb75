// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/nearest_rotation.h"

#include <Eigen/LU>

#include "kinematics/core/dense_algebra.h"

namespace kinescope {

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  const SingularValues svd = singular_value_decomposition(matrix);
  const Eigen::Matrix3d V = svd.V;
  Eigen::Matrix3d U = svd.U;
  if ((U * V.transpose()).determinant() < 0.0) U.col(2) *= -1.0;
  return U * V.transpose();
}

}  // namespace kinescope
