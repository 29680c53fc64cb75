// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/trace.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/calib/trace/linear_world.h"

namespace kinescope {
namespace {

using truth::Injected;
using truth::LinearWorld;
using truth::LinearWorldOptions;

Trace trace_of(std::uint64_t seed, const std::vector<Injected>& injected, double memory = 0.0,
               int instants = 400) {
  LinearWorldOptions options;
  options.seed = seed;
  options.noise_memory = memory;
  options.instants = instants;
  return trace_effects(LinearWorld(options, injected));
}

bool only(const Trace& trace, const EffectId& id) {
  return trace.verdict == TraceVerdict::kEffects && trace.accepted.size() == 1 &&
         trace.accepted.front().id == id;
}

TEST(TraceTest, CleanDataHoldNothing) {
  // At a rate of 1 % more than four of 100 would be a chance of 3e-3.
  constexpr int kRuns = 100;
  for (const double memory : {0.0, 0.8}) {
    int invented = 0;
    for (int seed = 0; seed < kRuns; ++seed) {
      const Trace trace = trace_of(static_cast<std::uint64_t>(seed), {}, memory);
      if (trace.verdict != TraceVerdict::kClean) ++invented;
    }
    EXPECT_LE(invented, 4) << "memory " << memory;
  }
}

TEST(TraceTest, NamesAndSizesEachEffect) {
  const std::vector<std::pair<Injected, EffectId>> cases{
      {{0, "scale", 0.5, 0.0}, {"scale", "joint1"}},
      {{1, "sine", 2.0, 0.0}, {"sine", "joint2"}},
      {{0, "gear", 0.5, 17.0}, {"gear", "joint1"}},
      {{1, "direction", 0.4, 0.0}, {"direction", "joint2"}},
      {{0, "step", 0.6, 6.3}, {"step", "joint1"}}};
  for (const auto& [injected, id] : cases) {
    int right = 0;
    int held = 0;
    constexpr int kRuns = 20;
    for (int seed = 0; seed < kRuns; ++seed) {
      const Trace trace = trace_of(static_cast<std::uint64_t>(seed), {injected});
      if (!only(trace, id)) continue;
      ++right;
      const TracedEffect& effect = trace.accepted.front();
      if (effect.interval.low <= injected.size && injected.size <= effect.interval.high) ++held;
      EXPECT_LT(trace.held_out_after.value, trace.held_out_before.value);
    }
    EXPECT_GE(right, 19) << injected.shape;
    EXPECT_GE(held, 16) << injected.shape;
  }
}

}  // namespace
}  // namespace kinescope
