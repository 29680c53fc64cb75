// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/encompassing.h"

#include <algorithm>
#include <cmath>

#include "calib/trace/stage.h"

namespace kinescope::trace {
namespace {

// Twice the logarithm of the odds: e^2, 88 of 100, a convention (Kass and Raftery 1995: positive
// evidence is 2 to 6).
constexpr double kClearly = 4.0;

// Twice the log likelihood that `effect` adds where `other` is in the model, by how the stretches
// scatter: that of noise of unknown size.
double added_beside(const NormalSystem& system, const std::vector<EffectColumn>& effect,
                    const std::vector<EffectColumn>& other) {
  const Linearisation with = extend(system.linear(), other, {});
  const Score score = jackknife_test(NormalSystem(with, system.partition()), effect);
  if (score.hidden()) return 0.0;
  return score.freedom * std::log1p(score.rank * score.statistic / score.freedom);
}

}  // namespace

double odds_of_second(const NormalSystem& system, const Rivalling& first, const Rivalling& second) {
  const double stretches = std::max(2, system.partition().stretches);
  const double clear = std::min(first.statistic, second.statistic);
  const double price = (second.freedom - first.freedom) * std::log(std::max(stretches, clear));
  return added_beside(system, second.columns, first.columns) -
         added_beside(system, first.columns, second.columns) - price;
}

Comparison compare_effects(const NormalSystem& system, const Rivalling& first,
                           const Rivalling& second) {
  const double odds = odds_of_second(system, first, second);
  if (odds <= -kClearly) return Comparison::kFirst;
  return odds >= kClearly ? Comparison::kSecond : Comparison::kInterchangeable;
}

}  // namespace kinescope::trace
