// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/dense_algebra.h"

namespace kinescope {

CholeskyFactor::CholeskyFactor(const Eigen::MatrixXd& matrix) : factor_(matrix) {}

Eigen::MatrixXd CholeskyFactor::lower() const { return factor_.matrixL(); }

Eigen::VectorXd CholeskyFactor::solve(const Eigen::VectorXd& right) const {
  return factor_.solve(right);
}

Eigen::MatrixXd CholeskyFactor::solve(const Eigen::MatrixXd& right) const {
  return factor_.solve(right);
}

Eigen::MatrixXd CholeskyFactor::inverse() const {
  return factor_.solve(Eigen::MatrixXd::Identity(factor_.rows(), factor_.cols()));
}

Eigen::VectorXd CholeskyFactor::whitened(const Eigen::VectorXd& v) const {
  return factor_.matrixL().solve(v);
}

LdltFactor::LdltFactor(const Eigen::MatrixXd& matrix) : factor_(matrix) {}

Eigen::VectorXd LdltFactor::solve(const Eigen::VectorXd& right) const {
  return factor_.solve(right);
}

Eigen::MatrixXd LdltFactor::solve(const Eigen::MatrixXd& right) const {
  return factor_.solve(right);
}

Eigen::MatrixXd LdltFactor::inverse() const {
  return factor_.solve(Eigen::MatrixXd::Identity(factor_.rows(), factor_.cols()));
}

Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  return LdltFactor(matrix).solve(right);
}

Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  return LdltFactor(matrix).solve(right);
}

}  // namespace kinescope
