// SPDX-License-Identifier: Apache-2.0
//
// Of two effects that both explain the residual: which one is it? Each is tested beside the other
// (Mizon and Richard 1986), and the one with more freedom pays for it: as many independent
// stretches as there are (Schwarz 1978), or as clear as they both are, where that is more (George
// and Foster 2000).
#pragma once

#include "calib/trace/family.h"

namespace kinescope::trace {

enum class Comparison {
  kFirst,           ///< the first one is clearly likelier
  kSecond,          ///< the second one is
  kInterchangeable  ///< this recording cannot tell
};

/// An effect at a value of its scan, how many numbers it was fitted with, and how clear it is where
/// the other one is not.
struct Rivalling {
  const std::vector<EffectColumn>& columns;
  double freedom = 1.0;
  double statistic = 0.0;  ///< F
};

/// Twice the logarithm of the odds of the second. `system` has neither in it.
[[nodiscard]] double odds_of_second(const NormalSystem& system, const Rivalling& first,
                                    const Rivalling& second);

/// By odds of 88 to 100. `system` has neither in it.
[[nodiscard]] Comparison compare_effects(const NormalSystem& system, const Rivalling& first,
                                         const Rivalling& second);

}  // namespace kinescope::trace
