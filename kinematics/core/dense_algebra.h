// SPDX-License-Identifier: Apache-2.0
//
// Decompositions of dense matrices: Eigen's own, compiled here once. Every file that names one of
// Eigen's classes compiles it anew, for seconds each; callers that decompose use these instead.
//   symmetric matrices  only the lower triangle is read
//   sizes               dynamic, and fixed ones where thousands are solved in a frame
//   not a number        is not refused: it is in the result, but LDL' takes such a pivot for zero
#pragma once

#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "kinematics/core/pose.h"

namespace kinescope {

/// matrix = vectors diag(values) vectors'.
struct SymmetricEigen {
  Eigen::VectorXd values;   ///< n, ascending
  Eigen::MatrixXd vectors;  ///< n x n, orthonormal columns in the order of the values
};

/// Eigenvalues and eigenvectors of a symmetric n x n matrix; empty for an empty one. Values that a
/// singular matrix has as zero come out as rounding of either sign. Tridiagonalisation and QR
/// (Golub and Van Loan 2013, section 8.3).
[[nodiscard]] SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix);
/// The values alone, ascending: a fraction of the work for large matrices.
[[nodiscard]] Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& matrix);

/// n factors that make the diagonal of diag(s) H diag(s) ones, H a normal matrix n x n: the columns
/// behind it then have unit length. 0 for a column of zeros.
[[nodiscard]] Eigen::VectorXd unit_scale(const Eigen::MatrixXd& H);

/// matrix = L L' of a symmetric positive definite n x n matrix, kept for several right sides.
class CholeskyFactor {
 public:
  CholeskyFactor() = default;
  explicit CholeskyFactor(const Eigen::MatrixXd& matrix);

  /// False also for a matrix that is singular to rounding; then nothing below means anything.
  [[nodiscard]] bool positive_definite() const { return factor_.info() == Eigen::Success; }
  [[nodiscard]] Eigen::MatrixXd lower() const;  ///< L, zeros above the diagonal
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& right) const;
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const;  ///< n x any
  [[nodiscard]] Eigen::MatrixXd inverse() const;
  /// L^-1 v: of unit covariance where v has the matrix for its covariance.
  [[nodiscard]] Eigen::VectorXd whitened(const Eigen::VectorXd& v) const;

 private:
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

/// matrix = P' L D L' P of a symmetric n x n matrix (Golub and Van Loan 2013, section 4.2.9), kept
/// for several right sides. A singular semi-definite matrix gives one of the solutions where there
/// is any: pivots that are zero leave their unknown at zero.
class LdltFactor {
 public:
  LdltFactor() = default;
  explicit LdltFactor(const Eigen::MatrixXd& matrix);

  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& right) const;
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const;  ///< n x any
  [[nodiscard]] Eigen::MatrixXd inverse() const;

 private:
  Eigen::LDLT<Eigen::MatrixXd> factor_;
};

/// matrix x = right by LDL', as LdltFactor does, for one use.
[[nodiscard]] Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& matrix,
                                              const Eigen::VectorXd& right);
[[nodiscard]] Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& matrix,
                                              const Eigen::MatrixXd& right);
/// The same without the heap.
[[nodiscard]] Vector6d solve_symmetric(const Matrix6d& matrix, const Vector6d& right);
[[nodiscard]] Eigen::Vector3d solve_symmetric(const Eigen::Matrix3d& matrix,
                                              const Eigen::Vector3d& right);
/// Inverse by LDL'; nothing for a matrix with a negative pivot. A singular one has an inverse that
/// is zero along the directions it is.
[[nodiscard]] std::optional<Matrix6d> inverse_of_positive(const Matrix6d& matrix);

/// The least |A x - b| for each column b of `right` (m x any), A m x n with m >= n: QR with column
/// pivoting. Of columns that depend on others the last in the pivots' order stay at zero.
[[nodiscard]] Eigen::MatrixXd least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& right);
/// The same for any shape and rank; of several solutions the shortest. Complete orthogonal
/// decomposition (Golub and Van Loan 2013, section 5.4.7).
[[nodiscard]] Eigen::VectorXd shortest_least_squares(const Eigen::MatrixXd& A,
                                                     const Eigen::VectorXd& right);

/// matrix = U diag(values) V'.
struct SingularValues {
  Eigen::MatrixXd U;       ///< m x m, orthonormal columns
  Eigen::VectorXd values;  ///< min(m, n), descending, none negative
  Eigen::MatrixXd V;       ///< n x n, orthonormal columns
};

/// Singular value decomposition of an m x n matrix by two-sided Jacobi rotations: small singular
/// values to full relative precision, for sizes up to some hundreds.
[[nodiscard]] SingularValues singular_value_decomposition(const Eigen::MatrixXd& matrix);
/// The values alone, descending.
[[nodiscard]] Eigen::VectorXd singular_values(const Eigen::MatrixXd& matrix);

}  // namespace kinescope
