// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include <Eigen/Core>

namespace kinescope::policy {

/// Central differences of f by every entry of x. Their error: step^2 by truncation, 1e-16 / step by
/// rounding, both below 1e-9 for functions of size 1.
inline Eigen::MatrixXd differences(const std::function<double(const Eigen::MatrixXd&)>& f,
                                   const Eigen::MatrixXd& x) {
  constexpr double kStep = 1e-5;
  Eigen::MatrixXd out(x.rows(), x.cols());
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    for (Eigen::Index j = 0; j < x.cols(); ++j) {
      Eigen::MatrixXd moved = x;
      moved(i, j) += kStep;
      const double above = f(moved);
      moved(i, j) -= 2.0 * kStep;
      out(i, j) = (above - f(moved)) / (2.0 * kStep);
    }
  }
  return out;
}

inline double largest(const Eigen::MatrixXd& x) { return x.cwiseAbs().maxCoeff(); }

}  // namespace kinescope::policy
