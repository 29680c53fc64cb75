// SPDX-License-Identifier: Apache-2.0
//
// Instants in groups: stretches of time within which noise may be alike, and folds that are held
// out together.
#pragma once

#include <vector>

#include "calib/trace/traced_model.h"

namespace kinescope::trace {

/// Both are numbered without gaps: one without an instant is none.
struct Partition {
  std::vector<int> stretch;  ///< of every instant
  std::vector<int> fold;     ///< of every instant
  int stretches = 0;
  int folds = 0;
  /// Variances found from stretches are to be multiplied by this: what neighbouring stretches still
  /// have in common.
  double widening = 1.0;
};

/// Stretches of a few correlation times, between `kFewStretches` and `kManyStretches` of them.
[[nodiscard]] Partition make_partition(const Linearisation& linear);

}  // namespace kinescope::trace
