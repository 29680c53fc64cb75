// SPDX-License-Identifier: Apache-2.0
#include <Eigen/QR>

#include "kinematics/core/dense_algebra.h"

namespace kinescope {

Eigen::MatrixXd least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& right) {
  return Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(A).solve(right);
}

Eigen::VectorXd shortest_least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& right) {
  return Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>(A).solve(right);
}

}  // namespace kinescope
