// SPDX-License-Identifier: Apache-2.0
//
// Kernel matrices and contractions with their derivatives, tile by tile; internal.
#pragma once

#include <functional>
#include <vector>

#include "dynamics/gp/kernel_node.h"

namespace kinescope::gp {

/// A block of samples against samples.
struct Tile {
  Eigen::Index row;
  Eigen::Index rows;
  Eigen::Index col;
  Eigen::Index cols;
};

/// Every `count`-th of several tiles, beginning with the `first`: what one of `count` processes
/// has.
struct Turn {
  Eigen::Index first = 0;
  Eigen::Index count = 1;
};

/// A kernel with its parameters, ready for large matrices. Rows and columns of all matrices are
/// sample-major: sample * outputs + output.
class Covariance {
 public:
  explicit Covariance(const Kernel& kernel);

  [[nodiscard]] Eigen::Index outputs() const { return outputs_; }
  [[nodiscard]] Prepared prepare(const Inputs& inputs) const;
  void prepare(const Inputs& inputs, Prepared& out) const;
  /// The same inputs prepared by another covariance of this kernel, for these parameters.
  void rescale(Prepared& out) const;

  /// The lower triangle of k(x, x); the tiles on the diagonal are complete, the rest is zero.
  [[nodiscard]] Eigen::MatrixXd lower(Workers& workers, const Prepared& x) const;
  /// The same into a matrix of the right size; what lies above the tiles stays.
  void lower(Workers& workers, const Prepared& x, Eigen::MatrixXd& out) const;
  [[nodiscard]] Eigen::MatrixXd cross(Workers& workers, const Prepared& x, const Prepared& y) const;
  /// Does something with k(x, y) for the samples of y from `begin` on: x.samples * outputs rows.
  using Panel = std::function<void(Eigen::Index begin, Eigen::Index size, Block cross)>;
  /// Calls `use` for every panel of tile_samples() of y whose turn it is, workers side by side.
  void cross_panels(Workers& workers, const Prepared& x, const Prepared& y, Turn turn,
                    const Panel& use) const;
  /// Some samples against some, in the calling thread.
  void tile(Samples a, Samples b, Scratch& scratch, Block out) const;
  /// k(x_i, x_i): samples * outputs.
  [[nodiscard]] Eigen::VectorXd diagonal(Workers& workers, const Prepared& x) const;

  /// Writes a block of Q; called once for each tile with row >= col (its first row and column).
  using Weights = std::function<void(Eigen::Index row, Eigen::Index col, Scratch& scratch, Block)>;
  /// d/dtheta sum_ij Q_ij k_ij over the whole symmetric matrix, from the tiles of its lower half.
  [[nodiscard]] Eigen::VectorXd contract_lower(Workers& workers, const Prepared& x,
                                               const Weights& weights) const;
  /// Samples in a tile.
  [[nodiscard]] Eigen::Index tile_samples() const { return tile_samples_; }

 private:
  void fill_tiles(Workers& workers, const std::vector<Tile>& tiles, const Prepared& x,
                  const Prepared& y, Eigen::MatrixXd& out) const;
  void contract_tile(Samples a, Samples b, const ConstBlock& q, Scratch& scratch,
                     Gradient out) const;

  std::shared_ptr<const KernelNode> node_;
  Eigen::VectorXd theta_;
  Eigen::Index outputs_;
  Eigen::Index tile_samples_;
};

}  // namespace kinescope::gp
