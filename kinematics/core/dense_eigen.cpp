// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <Eigen/Eigenvalues>

#include "kinematics/core/dense_algebra.h"

namespace kinescope {

Eigen::VectorXd unit_scale(const Eigen::MatrixXd& H) {
  return H.diagonal().unaryExpr([](double h) { return h > 0.0 ? 1.0 / std::sqrt(h) : 0.0; });
}

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix) {
  if (matrix.rows() == 0) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& matrix) {
  if (matrix.rows() == 0) return {};
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly)
      .eigenvalues();
}

}  // namespace kinescope
