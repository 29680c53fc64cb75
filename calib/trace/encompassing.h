// SPDX-License-Identifier: Apache-2.0
//
// Of two effects that both explain the residual: which one is it? Each is tested beside the other
// (Mizon and Richard 1986), and the one with more freedom pays for it (Schwarz 1978).
#pragma once

#include "calib/trace/family.h"

namespace kinescope::trace {

enum class Comparison {
  kFirst,           ///< the first one is clearly likelier
  kSecond,          ///< the second one is
  kInterchangeable  ///< this recording cannot tell
};

/// An effect at a value of its scan, and how many numbers it was fitted with.
struct Rivalling {
  const std::vector<EffectColumn>& columns;
  double freedom = 1.0;
};

/// `system` has neither in it.
[[nodiscard]] Comparison compare_effects(const NormalSystem& system, const Rivalling& first,
                                         const Rivalling& second);

}  // namespace kinescope::trace
