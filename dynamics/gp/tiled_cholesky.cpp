// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/tiled_cholesky.h"

#include <algorithm>
#include <vector>

namespace kinescope::gp {
namespace {

using Eigen::Index;

// Large matrices take larger tiles: products of 512 reach the peak of one core, and small matrices
// still give both cores enough tiles. Depends on the size alone, never on the number of threads.
Index tile_for(Index rows) { return rows > 3000 ? 512 : 256; }

struct TileRange {
  Index begin;
  Index size;
};

TileRange tile(Index index, Index width, Index rows) {
  const Index begin = index * width;
  return {begin, std::min(width, rows - begin)};
}

struct Pair {
  Index row;
  Index col;
};

}  // namespace

Index tiled_cholesky(Workers& workers, Block a) {
  const Index n = a.rows();
  const Index width = tile_for(n);
  const Index tiles = (n + width - 1) / width;
  for (Index k = 0; k < tiles; ++k) {
    const TileRange pivot = tile(k, width, n);
    Block diagonal = a.block(pivot.begin, pivot.begin, pivot.size, pivot.size);
    if (const int info = cholesky(diagonal); info != 0) return pivot.begin + info;
    diagonal.triangularView<Eigen::StrictlyUpper>().setZero();
    a.block(pivot.begin, pivot.begin + pivot.size, pivot.size, n - pivot.begin - pivot.size)
        .setZero();
    workers.run(tiles - k - 1, [&](Index task, Scratch&) {
      const TileRange row = tile(k + 1 + task, width, n);
      solve_lower_transposed_right(diagonal, a.block(row.begin, pivot.begin, row.size, pivot.size));
    });
    std::vector<Pair> trailing;
    for (Index j = k + 1; j < tiles; ++j) {
      for (Index i = j; i < tiles; ++i) trailing.push_back({i, j});
    }
    workers.run(static_cast<Index>(trailing.size()), [&](Index task, Scratch&) {
      const Pair pair = trailing[static_cast<std::size_t>(task)];
      const TileRange row = tile(pair.row, width, n);
      const TileRange col = tile(pair.col, width, n);
      const ConstBlock left = a.block(row.begin, pivot.begin, row.size, pivot.size);
      Block target = a.block(row.begin, col.begin, row.size, col.size);
      if (pair.row == pair.col) {
        add_square(-1.0, left, 1.0, target);
      } else {
        product_transposed(-1.0, left, a.block(col.begin, pivot.begin, col.size, pivot.size), 1.0,
                           target);
      }
    });
  }
  return 0;
}

// Columns from last to first: W_jj = L_jj^-1, W_(>j)j = -W_(>j)(>j) L_(>j)j W_jj.
void tiled_invert_lower(Workers& workers, Block l) {
  const Index n = l.rows();
  constexpr Index kWidth = 256;
  const Index tiles = (n + kWidth - 1) / kWidth;
  Eigen::MatrixXd panel(n, std::min(n, kWidth));
  for (Index j = tiles - 1; j >= 0; --j) {
    const TileRange col = tile(j, kWidth, n);
    Block diagonal = l.block(col.begin, col.begin, col.size, col.size);
    invert_lower(diagonal);
    const Index below = col.begin + col.size;
    panel.topLeftCorner(n - below, col.size) = l.block(below, col.begin, n - below, col.size);
    workers.run(tiles - j - 1, [&](Index task, Scratch& scratch) {
      const Scratch::Frame frame(scratch);
      // The longest rows first, so that the workers end together.
      const TileRange row = tile(tiles - 1 - task, kWidth, n);
      const Index inner = row.begin + row.size - below;
      Eigen::Map<Eigen::MatrixXd> sum = scratch.take(row.size, col.size);
      product(-1.0, l.block(row.begin, below, row.size, inner),
              panel.topLeftCorner(inner, col.size), 0.0, sum);
      product(1.0, sum, diagonal, 0.0, l.block(row.begin, col.begin, row.size, col.size));
    });
  }
}

}  // namespace kinescope::gp
