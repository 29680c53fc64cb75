// SPDX-License-Identifier: Apache-2.0
//
// Known decompositions, laws at random, and what happens to matrices without full rank.
#include "kinematics/core/dense_algebra.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

// Decompositions of matrices of up to 12 x 12 with entries of size 1: some hundreds of roundings.
constexpr double kRounding = 1e-12;
// Solutions where the matrix is conditioned up to 1e4.
constexpr double kSolved = 1e-8;

Eigen::MatrixXd random_matrix(Rng& rng, Eigen::Index rows, Eigen::Index cols) {
  Eigen::MatrixXd out(rows, cols);
  for (Eigen::Index c = 0; c < cols; ++c) {
    for (Eigen::Index r = 0; r < rows; ++r) out(r, c) = rng.normal();
  }
  return out;
}

Eigen::MatrixXd random_symmetric(Rng& rng, Eigen::Index n) {
  const Eigen::MatrixXd A = random_matrix(rng, n, n);
  return A + A.transpose();
}

// Eigenvalues at 0.1 and more.
Eigen::MatrixXd random_positive(Rng& rng, Eigen::Index n) {
  const Eigen::MatrixXd A = random_matrix(rng, n, n);
  return A * A.transpose() + 0.1 * Eigen::MatrixXd::Identity(n, n);
}

Eigen::MatrixXd identity(Eigen::Index n) { return Eigen::MatrixXd::Identity(n, n); }

// Second differences: eigenvalues 2 - 2 cos(k pi / (n + 1)).
Eigen::MatrixXd second_differences(Eigen::Index n) {
  Eigen::MatrixXd out = 2.0 * identity(n);
  out.diagonal(1).setConstant(-1.0);
  out.diagonal(-1).setConstant(-1.0);
  return out;
}

TEST(SymmetricEigen, KnownValuesAscend) {
  constexpr Eigen::Index n = 9;
  const SymmetricEigen eigen = symmetric_eigen(second_differences(n));
  for (Eigen::Index k = 0; k < n; ++k) {
    const double angle = static_cast<double>(k + 1) * std::numbers::pi / (n + 1.0);
    EXPECT_NEAR(eigen.values[k], 2.0 - 2.0 * std::cos(angle), kRounding);
  }
}

RC_GTEST_PROP(SymmetricEigen, VectorsRebuildTheMatrix, (unsigned seed)) {
  Rng rng(seed);
  const Eigen::Index n = 1 + rng.index(12);
  const Eigen::MatrixXd A = random_symmetric(rng, n);
  const SymmetricEigen eigen = symmetric_eigen(A);
  RC_ASSERT((eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose() - A).norm() <
            kRounding);
  RC_ASSERT((eigen.vectors.transpose() * eigen.vectors - identity(n)).norm() < kRounding);
  RC_ASSERT(std::is_sorted(eigen.values.begin(), eigen.values.end()));
  RC_ASSERT((symmetric_eigenvalues(A) - eigen.values).norm() < kRounding);
}

TEST(SymmetricEigen, ReadsTheLowerTriangle) {
  Rng rng = Rng::from_name("lower triangle");
  const Eigen::MatrixXd A = random_symmetric(rng, 5);
  const Eigen::MatrixXd lower = A.triangularView<Eigen::Lower>();
  EXPECT_EQ(symmetric_eigen(lower).values, symmetric_eigen(A).values);
}

TEST(SymmetricEigen, SingularAndEmpty) {
  const Eigen::Vector3d v(1.0, 2.0, -2.0);
  const SymmetricEigen eigen = symmetric_eigen(v * v.transpose());
  EXPECT_NEAR(eigen.values[0], 0.0, kRounding);
  EXPECT_NEAR(eigen.values[1], 0.0, kRounding);
  EXPECT_NEAR(eigen.values[2], 9.0, kRounding);
  EXPECT_NEAR(std::abs(eigen.vectors.col(2).dot(v / 3.0)), 1.0, kRounding);
  EXPECT_EQ(symmetric_eigen(Eigen::MatrixXd(0, 0)).values.size(), 0);
  EXPECT_EQ(symmetric_eigenvalues(Eigen::MatrixXd(0, 0)).size(), 0);
}

TEST(CholeskyFactor, KnownFactor) {
  Eigen::Matrix3d L;
  L << 2, 0, 0, 6, 1, 0, -8, 5, 3;
  const CholeskyFactor factor(L * L.transpose());
  ASSERT_TRUE(factor.positive_definite());
  EXPECT_LT((factor.lower() - L).norm(), kRounding);
}

RC_GTEST_PROP(CholeskyFactor, SolvesAndWhitens, (unsigned seed)) {
  Rng rng(seed);
  const Eigen::Index n = 1 + rng.index(12);
  const Eigen::MatrixXd A = random_positive(rng, n);
  const Eigen::MatrixXd B = random_matrix(rng, n, 3);
  const Eigen::VectorXd b = B.col(0);
  const CholeskyFactor factor(A);
  RC_ASSERT(factor.positive_definite());
  RC_ASSERT((A * factor.solve(B) - B).norm() < kSolved);
  RC_ASSERT((A * factor.solve(b) - b).norm() < kSolved);
  RC_ASSERT((A * factor.inverse() - identity(n)).norm() < kSolved);
  RC_ASSERT((factor.lower() * factor.whitened(b) - b).norm() < kSolved);
  RC_ASSERT(std::abs(factor.whitened(b).squaredNorm() - (b.dot(factor.solve(b)))) < kSolved);
}

TEST(CholeskyFactor, TellsWhatIsNotPositiveDefinite) {
  const Eigen::Vector3d v(1.0, 2.0, -2.0);
  EXPECT_FALSE(CholeskyFactor(v * v.transpose()).positive_definite());
  EXPECT_FALSE(CholeskyFactor(-identity(4)).positive_definite());
}

RC_GTEST_PROP(LdltFactor, SolvesIndefiniteMatrices, (unsigned seed)) {
  Rng rng(seed);
  const Eigen::Index n = 1 + rng.index(12);
  // Negative and positive eigenvalues, none near zero.
  const Eigen::MatrixXd Q = symmetric_eigen(random_symmetric(rng, n)).vectors;
  Eigen::VectorXd values(n);
  for (Eigen::Index k = 0; k < n; ++k) values[k] = (k % 2 == 0 ? 1.0 : -1.0) * rng.uniform(0.5, 3);
  values[0] = 3.0 * static_cast<double>(n);  // the pivots' growth stays small
  const Eigen::MatrixXd A = Q * values.asDiagonal() * Q.transpose() + 4.0 * identity(n);
  const Eigen::MatrixXd B = random_matrix(rng, n, 4);
  const Eigen::VectorXd b = B.col(1);
  const LdltFactor factor(A);
  RC_ASSERT((A * factor.solve(B) - B).norm() < kSolved);
  RC_ASSERT((A * factor.solve(b) - b).norm() < kSolved);
  RC_ASSERT((A * factor.inverse() - identity(n)).norm() < kSolved);
  RC_ASSERT((solve_symmetric(A, B) - factor.solve(B)).norm() < kRounding);
  RC_ASSERT((solve_symmetric(A, b) - factor.solve(b)).norm() < kRounding);
}

RC_GTEST_PROP(SolveSymmetric, FixedSizesAgreeWithDynamicOnes, (unsigned seed)) {
  Rng rng(seed);
  const Eigen::MatrixXd A = random_positive(rng, 6);
  const Eigen::VectorXd b = random_matrix(rng, 6, 1);
  const Matrix6d A6 = A;
  const Vector6d b6 = b;
  RC_ASSERT((solve_symmetric(A6, b6) - solve_symmetric(A, b)).norm() < kSolved);
  const std::optional<Matrix6d> inverse = inverse_of_positive(A6);
  RC_ASSERT(inverse.has_value());
  RC_ASSERT((*inverse * A6 - Matrix6d::Identity()).norm() < kSolved);
  const Eigen::Matrix3d A3 = A.topLeftCorner<3, 3>();
  const Eigen::Vector3d b3 = b.head<3>();
  RC_ASSERT((A3 * solve_symmetric(A3, b3) - b3).norm() < kSolved);
}

TEST(SolveSymmetric, ASingularMatrixGivesOneOfTheSolutions) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(4, 4);
  A.topLeftCorner(2, 2) << 4.0, 1.0, 1.0, 3.0;
  const Eigen::VectorXd b = Eigen::Vector4d(1.0, 2.0, 0.0, 0.0);
  const Eigen::VectorXd x = solve_symmetric(A, b);
  EXPECT_LT((A * x - b).norm(), kRounding);
  EXPECT_EQ(x.tail(2), Eigen::VectorXd::Zero(2));
}

TEST(InverseOfPositive, NothingForANegativePivot) {
  Vector6d diagonal = Vector6d::Ones();
  diagonal[3] = -1e-3;
  EXPECT_FALSE(inverse_of_positive(Matrix6d(diagonal.asDiagonal())).has_value());
  EXPECT_FALSE(inverse_of_positive(-Matrix6d::Identity()).has_value());
}

TEST(InverseOfPositive, ASingularMatrixKeepsItsZeros) {
  Vector6d diagonal;
  diagonal << 4.0, 2.0, 1.0, 0.5, 0.25, 0.0;
  const std::optional<Matrix6d> inverse = inverse_of_positive(Matrix6d(diagonal.asDiagonal()));
  ASSERT_TRUE(inverse.has_value());
  Vector6d expected;
  expected << 0.25, 0.5, 1.0, 2.0, 4.0, 0.0;
  EXPECT_LT((*inverse - Matrix6d(expected.asDiagonal())).norm(), kRounding);
}

RC_GTEST_PROP(LeastSquares, WhatIsLeftIsAcrossTheColumns, (unsigned seed)) {
  Rng rng(seed);
  const Eigen::Index n = 1 + rng.index(5);
  const Eigen::MatrixXd A = random_matrix(rng, n + 6, n);
  const Eigen::MatrixXd B = random_matrix(rng, n + 6, 2);
  const Eigen::MatrixXd X = least_squares(A, B);
  RC_ASSERT((A.transpose() * (B - A * X)).norm() < kSolved);
  const Eigen::VectorXd b = B.col(0);
  RC_ASSERT((shortest_least_squares(A, b) - X.col(0)).norm() < kSolved);
}

TEST(LeastSquares, DependentColumns) {
  Rng rng = Rng::from_name("dependent columns");
  Eigen::MatrixXd A = random_matrix(rng, 8, 3);
  const Eigen::MatrixXd independent = A;
  A.conservativeResize(8, 4);
  A.col(3) = A.col(0) + A.col(1);
  const Eigen::VectorXd b = random_matrix(rng, 8, 1);
  const double least = (b - independent * least_squares(independent, b)).norm();
  const Eigen::VectorXd basic = least_squares(A, b);
  const Eigen::VectorXd shortest = shortest_least_squares(A, b);
  EXPECT_NEAR((b - A * basic).norm(), least, kRounding);
  EXPECT_NEAR((b - A * shortest).norm(), least, kRounding);
  EXPECT_EQ((basic.array() == 0.0).count(), 1);
  // The shortest has no part along what the columns cannot show: (1, 1, 0, -1).
  EXPECT_NEAR(shortest[0] + shortest[1] - shortest[3], 0.0, kRounding);
  EXPECT_LT(shortest.norm(), basic.norm());
}

TEST(LeastSquares, TheShortestOfFewerRowsThanColumns) {
  const Eigen::MatrixXd A = Eigen::RowVector3d(1.0, 2.0, 2.0);
  const Eigen::VectorXd b = Eigen::VectorXd::Constant(1, 9.0);
  EXPECT_LT((shortest_least_squares(A, b) - Eigen::Vector3d(1.0, 2.0, 2.0)).norm(), kRounding);
}

RC_GTEST_PROP(SingularValues, RebuildTheMatrix, (unsigned seed)) {
  Rng rng(seed);
  const Eigen::Index rows = 1 + rng.index(9);
  const Eigen::Index cols = 1 + rng.index(9);
  const Eigen::MatrixXd A = random_matrix(rng, rows, cols);
  const SingularValues svd = singular_value_decomposition(A);
  Eigen::MatrixXd middle = Eigen::MatrixXd::Zero(rows, cols);
  middle.diagonal() = svd.values;
  RC_ASSERT((svd.U * middle * svd.V.transpose() - A).norm() < kRounding);
  RC_ASSERT((svd.U.transpose() * svd.U - identity(rows)).norm() < kRounding);
  RC_ASSERT((svd.V.transpose() * svd.V - identity(cols)).norm() < kRounding);
  RC_ASSERT(std::is_sorted(svd.values.begin(), svd.values.end(), std::greater<>()));
  RC_ASSERT((singular_values(A) - svd.values).norm() < kRounding);
}

TEST(SingularValues, SmallOnesToFullPrecision) {
  // Columns at right angles of lengths 3 and 3e-12.
  Eigen::Matrix<double, 3, 2> A;
  A << 2.0, 2e-12, 2.0, -1e-12, 1.0, -2e-12;
  const Eigen::VectorXd values = singular_values(A);
  EXPECT_NEAR(values[0], 3.0, kRounding);
  EXPECT_NEAR(values[1], 3e-12, 3e-12 * 1e-3);  // the columns' 1e-16 of 3 against 3e-12
}

TEST(SingularValues, RankOne) {
  const SingularValues svd =
      singular_value_decomposition(Eigen::Vector3d(1.0, 2.0, 2.0) * Eigen::RowVector2d(3.0, 4.0));
  EXPECT_NEAR(svd.values[0], 15.0, kRounding);
  EXPECT_NEAR(svd.values[1], 0.0, kRounding);
  EXPECT_LT((svd.U.transpose() * svd.U - identity(3)).norm(), kRounding);
}

TEST(DenseAlgebra, NotANumber) {
  Eigen::MatrixXd A = identity(3);
  A(1, 1) = std::numeric_limits<double>::quiet_NaN();
  const Eigen::VectorXd b = Eigen::VectorXd::Ones(3);
  EXPECT_FALSE(symmetric_eigenvalues(A).allFinite());
  EXPECT_FALSE(CholeskyFactor(A).solve(b).allFinite());
  EXPECT_EQ(solve_symmetric(A, b)[1], 0.0);
}

}  // namespace
}  // namespace kinescope
