// SPDX-License-Identifier: Apache-2.0
//
// Instants in groups: stretches of time within which noise may be alike, and folds that are held
// out together. A cell is what one stretch and one fold have in common, so that sums over cells
// give sums over either.
#pragma once

#include <vector>

#include "calib/trace/traced_model.h"

namespace kinescope::trace {

struct Cell {
  int stretch = 0;
  int fold = 0;
};

struct Partition {
  std::vector<Cell> cells;
  std::vector<int> cell;  ///< of every instant
  int stretches = 0;
  int folds = 0;
  /// Variances found from stretches are to be multiplied by this: what neighbouring stretches still
  /// have in common.
  double widening = 1.0;
};

/// Stretches of a few correlation times, between `kFewStretches` and `kManyStretches` of them.
[[nodiscard]] Partition make_partition(const Linearisation& linear);

}  // namespace kinescope::trace
