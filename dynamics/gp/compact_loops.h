// SPDX-License-Identifier: Apache-2.0
//
// The inner loops of compact.h, for the processes of all joints at once: a table of points is read
// from memory once, and memory is what these loops wait for.
//
// Eight rows go together whatever the registers' width, exponentials are made of products and sums
// alone, and the compiler fuses none of them (CMakeLists.txt): a saved model has the same answer on
// every processor.
#pragma once

#include <Eigen/Core>

#include "dynamics/gp/robot_kernels.h"

namespace kinescope::gp::loops {

inline constexpr Eigen::Index kLanes = 8;

/// A table whose rows are kept eight by eight, each column's together; zeros fill the last ones.
class LaneTable {
 public:
  LaneTable() = default;
  explicit LaneTable(const Eigen::MatrixXd& table);

  [[nodiscard]] Eigen::Index columns() const { return columns_; }
  /// Rows, with those of zeros.
  [[nodiscard]] Eigen::Index rows() const { return blocks_ * kLanes; }
  /// Eight values of the first column, of the second one, ..., then those of the next rows.
  [[nodiscard]] const double* data() const { return values_.data(); }

 private:
  Eigen::Index columns_ = 0;
  Eigen::Index blocks_ = 0;
  Eigen::VectorXd values_;
};

/// What these loops are compiled for.
enum class Registers { k128, k256, k512 };  // bit
/// The widest that this processor has.
[[nodiscard]] Registers widest_registers();

/// out_ij += variances_j exp(-1/2 sum_d factors_jd (table_id - x_d)^2): rows x processes.
void add_rbf(const LaneTable& table, const Eigen::VectorXd& x, const Eigen::MatrixXd& factors,
             const Eigen::VectorXd& variances, Eigen::MatrixXd& out,
             Registers registers = widest_registers());

/// One row a process, times what the sample has in that column.
struct PolynomialFactors {
  Eigen::VectorXd offsets;
  Eigen::MatrixXd motion;
  Eigen::MatrixXd first;  ///< of positions
  Eigen::MatrixXd second;
};

/// out_ij = (offsets_j + sum_d motions_id motion_jd) prod_k (1 + sum_d positions_id first_jd)
/// (1 + sum_d positions_id second_jd): the inner sums over the two columns of a turning joint k, or
/// the one of a sliding joint.
void polynomials(const LaneTable& motions, const LaneTable& positions, const JointKinds& joints,
                 const PolynomialFactors& factors, Eigen::MatrixXd& out,
                 Registers registers = widest_registers());

[[nodiscard]] double dot(const double* a, const double* b, Eigen::Index size);

/// out = R k for an upper triangle packed by columns.
void triangle_times(const double* packed, const double* k, Eigen::Index size, double* out);

}  // namespace kinescope::gp::loops
