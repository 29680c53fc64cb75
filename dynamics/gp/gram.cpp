// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/gram.h"

#include <algorithm>

namespace kinescope::gp {
namespace {

using Eigen::Index;

// 256 x 256 doubles fill half of a usual second-level cache.
constexpr Index kTileRows = 256;
// Samples in a tile come in strips of so many (lip_pairs.h).
constexpr Index kStrip = 8;

std::vector<Tile> make_tiles(Index rows, Index cols, Index width, bool lower) {
  std::vector<Tile> tiles;
  for (Index col = 0; col < cols; col += width) {
    for (Index row = lower ? col : 0; row < rows; row += width) {
      tiles.push_back({row, std::min(width, rows - row), col, std::min(width, cols - col)});
    }
  }
  return tiles;
}

// Calls f(row and column in sample-major order, row and column in output-major order) for every
// entry of a block of rows x cols.
template <typename F>
void for_each_entry(Index rows, Index cols, Index outputs, F f) {
  const Index row_samples = rows / outputs;
  const Index col_samples = cols / outputs;
  for (Index b = 0; b < outputs; ++b) {
    for (Index j = 0; j < col_samples; ++j) {
      for (Index a = 0; a < outputs; ++a) {
        for (Index i = 0; i < row_samples; ++i) {
          f(i * outputs + a, j * outputs + b, a * row_samples + i, b * col_samples + j);
        }
      }
    }
  }
}

// Output-major tile to sample-major block and back.
void scatter(const ConstBlock& tile, Index outputs, Block out) {
  for_each_entry(tile.rows(), tile.cols(), outputs,
                 [&](Index r, Index c, Index tr, Index tc) { out(r, c) = tile(tr, tc); });
}

void gather(const ConstBlock& block, Index outputs, Block tile) {
  for_each_entry(tile.rows(), tile.cols(), outputs,
                 [&](Index r, Index c, Index tr, Index tc) { tile(tr, tc) = block(r, c); });
}

// In the order of the tiles, whoever worked on them.
Eigen::VectorXd add_columns(const Eigen::MatrixXd& parts) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(parts.rows());
  for (Index k = 0; k < parts.cols(); ++k) sum += parts.col(k);
  return sum;
}

}  // namespace

Covariance::Covariance(const Kernel& kernel)
    : node_(kernel.shared_node()),
      theta_(kernel.log_values()),
      outputs_(kernel.outputs()),
      tile_samples_(std::max(kStrip, kTileRows / kernel.outputs() / kStrip * kStrip)) {}

void Covariance::prepare(const Inputs& inputs, Prepared& out) const {
  node_->featurise(inputs, out);
  node_->rescale(theta_, out);
}

void Covariance::rescale(Prepared& out) const { node_->rescale(theta_, out); }

Prepared Covariance::prepare(const Inputs& inputs) const {
  Prepared out;
  prepare(inputs, out);
  return out;
}

void Covariance::tile(Samples a, Samples b, Scratch& scratch, Block out) const {
  if (outputs_ == 1) {
    node_->evaluate(theta_, a, b, scratch, out);
    return;
  }
  const Scratch::Frame frame(scratch);
  Eigen::Map<Eigen::MatrixXd> own = scratch.take(out.rows(), out.cols());
  node_->evaluate(theta_, a, b, scratch, own);
  scatter(own, outputs_, out);
}

void Covariance::fill_tiles(Workers& workers, const std::vector<Tile>& tiles, const Prepared& x,
                            const Prepared& y, Eigen::MatrixXd& out) const {
  const Index m = outputs_;
  workers.run(static_cast<Index>(tiles.size()), [&](Index task, Scratch& scratch) {
    const Tile& t = tiles[static_cast<std::size_t>(task)];
    tile({x, t.row, t.rows}, {y, t.col, t.cols}, scratch,
         out.block(t.row * m, t.col * m, t.rows * m, t.cols * m));
  });
}

void Covariance::lower(Workers& workers, const Prepared& x, Eigen::MatrixXd& out) const {
  fill_tiles(workers, make_tiles(x.samples, x.samples, tile_samples_, true), x, x, out);
}

Eigen::MatrixXd Covariance::lower(Workers& workers, const Prepared& x) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(x.samples * outputs_, x.samples * outputs_);
  lower(workers, x, out);
  return out;
}

Eigen::MatrixXd Covariance::cross(Workers& workers, const Prepared& x, const Prepared& y) const {
  Eigen::MatrixXd out(x.samples * outputs_, y.samples * outputs_);
  fill_tiles(workers, make_tiles(x.samples, y.samples, tile_samples_, false), x, y, out);
  return out;
}

void Covariance::cross_panels(Workers& workers, const Prepared& x, const Prepared& y, Turn turn,
                              const Panel& use) const {
  const Index m = outputs_;
  const Index width = tile_samples_;
  const Index panels = (y.samples + width - 1) / width;
  workers.run(
      (panels - turn.first + turn.count - 1) / turn.count, [&](Index task, Scratch& scratch) {
        const Scratch::Frame frame(scratch);
        const Index begin = (task * turn.count + turn.first) * width;
        const Index size = std::min(width, y.samples - begin);
        Eigen::Map<Eigen::MatrixXd> cross = scratch.take(x.samples * m, size * m);
        for (Index row = 0; row < x.samples; row += width) {
          const Index rows = std::min(width, x.samples - row);
          tile({x, row, rows}, {y, begin, size}, scratch, cross.middleRows(row * m, rows * m));
        }
        use(begin, size, cross);
      });
}

Eigen::VectorXd Covariance::diagonal(Workers& workers, const Prepared& x) const {
  Eigen::VectorXd out(x.samples * outputs_);
  constexpr Index kChunk = 1024;
  workers.run((x.samples + kChunk - 1) / kChunk, [&](Index task, Scratch& scratch) {
    const Scratch::Frame frame(scratch);
    Eigen::Map<Eigen::MatrixXd> own = scratch.take(outputs_, outputs_);
    for (Index i = task * kChunk; i < std::min(x.samples, (task + 1) * kChunk); ++i) {
      node_->evaluate(theta_, {x, i, 1}, {x, i, 1}, scratch, own);
      out.segment(i * outputs_, outputs_) = own.diagonal();
    }
  });
  return out;
}

void Covariance::contract_tile(Samples a, Samples b, const ConstBlock& q, Scratch& scratch,
                               Gradient out) const {
  if (outputs_ == 1) {
    node_->contract(theta_, a, b, q, scratch, out);
    return;
  }
  const Scratch::Frame frame(scratch);
  Eigen::Map<Eigen::MatrixXd> own = scratch.take(q.rows(), q.cols());
  gather(q, outputs_, own);
  node_->contract(theta_, a, b, own, scratch, out);
}

Eigen::VectorXd Covariance::contract_lower(Workers& workers, const Prepared& x,
                                           const Weights& weights) const {
  const std::vector<Tile> tiles = make_tiles(x.samples, x.samples, tile_samples_, true);
  Eigen::MatrixXd parts = Eigen::MatrixXd::Zero(theta_.size(), static_cast<Index>(tiles.size()));
  const Index m = outputs_;
  workers.run(parts.cols(), [&](Index task, Scratch& scratch) {
    const Tile& t = tiles[static_cast<std::size_t>(task)];
    const Scratch::Frame frame(scratch);
    Eigen::Map<Eigen::MatrixXd> q = scratch.take(t.rows * m, t.cols * m);
    weights(t.row * m, t.col * m, scratch, q);
    // What lies above the diagonal counts with what lies below.
    if (t.row != t.col) q *= 2.0;
    contract_tile({x, t.row, t.rows}, {x, t.col, t.cols}, q, scratch, parts.col(task));
  });
  return add_columns(parts);
}

}  // namespace kinescope::gp
