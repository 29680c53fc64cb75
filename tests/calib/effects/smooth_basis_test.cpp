// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/smooth_basis.h"

#include <cmath>

#include <gtest/gtest.h>

#include "calib/effects/error_table.h"

namespace kinescope {
namespace {

using effects::SmoothBasis;

// Prior covariance of the values is that of the process.
TEST(SmoothBasis, DrawsAreThoseOfAGaussianProcess) {
  constexpr double kLength = 0.3;
  const Eigen::VectorXd at = Eigen::VectorXd::LinSpaced(41, -1.0, 2.0);
  const Eigen::MatrixXd shares = SmoothBasis(-1.0, 2.0, kLength).at(at);
  const Eigen::MatrixXd covariance = shares * shares.transpose();
  for (Eigen::Index i = 0; i < at.size(); ++i) {
    for (Eigen::Index k = 0; k < at.size(); ++k) {
      const double d = (at[i] - at[k]) / kLength;
      EXPECT_NEAR(covariance(i, k), std::exp(-0.5 * d * d), 0.03) << at[i] << " " << at[k];
    }
  }
}

TEST(SmoothBasis, FarFromWhereItWasSeenItIsNothing) {
  const SmoothBasis basis(0.0, 1.0, 0.1);
  EXPECT_LT(basis.at(Eigen::VectorXd::Constant(1, 1.6)).norm(), 1e-3);
  EXPECT_LT(basis.at(Eigen::VectorXd::Constant(1, -5.0)).norm(), 1e-12);
}

TEST(ErrorTable, IsLinearBetweenItsPointsAndNothingBeyond) {
  ErrorTable table;
  table.value = Eigen::Vector3d(0.0, 1.0, 3.0);
  table.error = Eigen::Vector3d(1.0, 2.0, -2.0);
  const Eigen::VectorXd at = (Eigen::VectorXd(6) << -0.1, 0.0, 0.5, 1.0, 2.5, 3.1).finished();
  const Eigen::VectorXd expected = (Eigen::VectorXd(6) << 0.0, 1.0, 1.5, 2.0, -1.0, 0.0).finished();
  EXPECT_LT((table.at(at) - expected).cwiseAbs().maxCoeff(), 1e-15);
}

}  // namespace
}  // namespace kinescope
