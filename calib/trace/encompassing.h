// SPDX-License-Identifier: Apache-2.0
//
// Of two effects that both explain the residual: does either leave the other nothing to explain?
// Mizon and Richard 1986.
#pragma once

#include "calib/trace/family.h"

namespace kinescope::trace {

enum class Comparison {
  kFirst,           ///< the first one is needed beside the second
  kSecond,          ///< the second one makes the first superfluous, and not the other way round
  kInterchangeable  ///< either makes the other superfluous
};

/// `system` has neither in it. Two single tests, each at 5 %.
[[nodiscard]] Comparison compare_effects(const NormalSystem& system,
                                         const std::vector<EffectColumn>& first,
                                         const std::vector<EffectColumn>& second);

}  // namespace kinescope::trace
