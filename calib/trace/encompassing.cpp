// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/encompassing.h"

#include "calib/trace/stage.h"

namespace kinescope::trace {
namespace {

constexpr double kLevel = 0.05;

// Is `effect` needed where `other` is in the model?
bool needed_beside(const NormalSystem& system, const std::vector<EffectColumn>& effect,
                   const std::vector<EffectColumn>& other) {
  const Linearisation with = extend(system.linear(), other, {});
  const Score score = jackknife_test(NormalSystem(with, system.partition()), effect);
  return !score.hidden() && score.p_value < kLevel;
}

}  // namespace

Comparison compare_effects(const NormalSystem& system, const std::vector<EffectColumn>& first,
                           const std::vector<EffectColumn>& second) {
  if (needed_beside(system, first, second)) return Comparison::kFirst;
  return needed_beside(system, second, first) ? Comparison::kSecond : Comparison::kInterchangeable;
}

}  // namespace kinescope::trace
