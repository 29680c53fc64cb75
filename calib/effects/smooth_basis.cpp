// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/smooth_basis.h"

#include <cmath>

#include "kinematics/core/dense_algebra.h"

namespace kinescope::effects {
namespace {

// Nodes this much of a length apart: of a draw of the process they miss 1.6 % of its spread
// half-way between them, 5 % at the ends.
constexpr double kSpacing = 0.8;

}  // namespace

SmoothBasis::SmoothBasis(double low, double high, double length) : length_(length) {
  const double range = high - low;
  const auto intervals = static_cast<Eigen::Index>(std::ceil(range / (kSpacing * length)));
  const double step = kSpacing * length;
  nodes_ = Eigen::VectorXd::LinSpaced(
      intervals + 1, 0.5 * (low + high) - 0.5 * step * static_cast<double>(intervals),
      0.5 * (low + high) + 0.5 * step * static_cast<double>(intervals));
  Eigen::MatrixXd K = kernel(nodes_);
  K.diagonal().array() += 1e-10;
  const SymmetricEigen eigen = symmetric_eigen(K);
  whitening_ = eigen.vectors * eigen.values.cwiseMax(1e-10).cwiseSqrt().cwiseInverse().asDiagonal();
}

Eigen::MatrixXd SmoothBasis::kernel(const Eigen::VectorXd& values) const {
  Eigen::MatrixXd out(values.size(), nodes_.size());
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    for (Eigen::Index k = 0; k < nodes_.size(); ++k) {
      const double d = (values[i] - nodes_[k]) / length_;
      out(i, k) = std::exp(-0.5 * d * d);
    }
  }
  return out;
}

Eigen::MatrixXd SmoothBasis::at(const Eigen::VectorXd& values) const {
  return kernel(values) * whitening_;
}

}  // namespace kinescope::effects
