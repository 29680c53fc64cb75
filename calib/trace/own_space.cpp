// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/own_space.h"

#include <algorithm>

#include "kinematics/core/dense_algebra.h"

namespace kinescope::trace {

// The normal matrix gives a basis that is nearly orthonormal; its own products say what is missing
// (Cholesky QR twice, Yamamoto et al. 2015).
OwnSpace::OwnSpace(const NormalSystem& system) {
  const Linearisation& linear = system.linear();
  Eigen::MatrixXd H = system.total().H;
  if (linear.prior.size() > 0) H += linear.prior;
  const Eigen::VectorXd scale = unit_scale(H);
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * H * scale.asDiagonal());
  const Eigen::VectorXd& values = eigen.values;
  const Eigen::Index n = values.size();
  const double least = n == 0 ? 0.0 : kUnseen * std::max(values[n - 1], 1e-300);
  const auto shown = static_cast<Eigen::Index>((values.array() > least).count());
  const Eigen::MatrixXd directions = scale.asDiagonal() * eigen.vectors.rightCols(shown) *
                                     values.tail(shown).cwiseSqrt().cwiseInverse().asDiagonal();
  basis_ = linear.jacobian * directions;
  Eigen::MatrixXd products = basis_.transpose() * basis_;
  if (linear.prior.size() > 0) products += directions.transpose() * linear.prior * directions;
  factor_ = CholeskyFactor(products);
}

}  // namespace kinescope::trace
