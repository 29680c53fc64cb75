// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/trace.h"

#include <algorithm>
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

bool names(const Trace& trace, const EffectId& id) {
  return std::ranges::find(trace.accepted, id, &TracedEffect::id) != trace.accepted.end();
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
      {{0, "step", 0.6, 6.3}, {"step", "joint1"}},
      {{0, "coupling", 0.3, 0.0}, {"coupling", "joint1"}}};
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

// A step near the end: what few stretches carry is no better known than the noise allows.
TEST(TraceTest, TheIntervalOfWhatFewStretchesCarryHoldsTheTruth) {
  constexpr int kRuns = 60;
  const Injected step{0, "step", 4.0, 51.7};  // of 53.3 s: two of 59 stretches
  int found = 0;
  int held = 0;
  for (int seed = 0; seed < kRuns; ++seed) {
    const Trace trace = trace_of(static_cast<std::uint64_t>(seed), {step}, 0.8, 1600);
    if (!only(trace, {"step", "joint1"})) continue;
    ++found;
    const Interval& interval = trace.accepted.front().interval;
    if (interval.low <= step.size && step.size <= interval.high) ++held;
  }
  EXPECT_GE(found, kRuns / 2);
  // 95 % of 58: fewer than 52 would be a chance of 1 %.
  EXPECT_GE(held, 0.9 * found) << found;
}

TEST(TraceTest, ASearchEndsAfterAsManyFitsAsItMayTake) {
  LinearWorldOptions world;
  world.seed = 3;
  const LinearWorld both(world, {{0, "scale", 0.5, 0.0}, {1, "sine", 2.0, 0.0}});
  const Trace whole = trace_effects(both);
  EXPECT_EQ(whole.accepted.size(), 2U);
  TraceOptions options;
  options.most_fits = 2;  // the model as it is, and one effect
  const Trace cut = trace_effects(both, options);
  EXPECT_LT(cut.accepted.size(), 2U);
  EXPECT_TRUE(std::ranges::any_of(cut.steps, [](const TraceStep& step) {
    return step.words.starts_with("nothing more is looked for after ");
  }));
  options.most_fits = 1000;
  EXPECT_EQ(trace_effects(both, options).accepted.size(), 2U);
}

bool names(const Ambiguity& ambiguity, const EffectId& id) {
  return std::ranges::find(ambiguity.effects, id) != ambiguity.effects.end();
}

// Where both joints move alike, one that goes too far and one that is pulled along look the same.
TEST(TraceTest, InterchangeableEffectsAreBothNamed) {
  constexpr int kRuns = 10;
  int right = 0;
  for (int seed = 0; seed < kRuns; ++seed) {
    LinearWorldOptions options;
    options.seed = static_cast<std::uint64_t>(seed);
    options.together = true;
    const Trace trace = trace_effects(LinearWorld(options, {{0, "scale", 0.5}}));
    if (trace.verdict != TraceVerdict::kAmbiguous || trace.ambiguities.size() != 1) continue;
    const Ambiguity& found = trace.ambiguities.front();
    if (!names(found, {"scale", "joint1"}) || !names(found, {"coupling", "joint1"})) continue;
    ++right;
    EXPECT_EQ(found.words.size(), found.effects.size());
    EXPECT_TRUE(found.record == "record scale" || found.record == "record coupling");
    // The one in the model is the one that is handed on; the other is no effect of its own.
    ASSERT_EQ(trace.accepted.size(), 1U);
    EXPECT_EQ(trace.accepted.front().id, found.effects.front());
    for (const NotFoundEffect& missing : trace.not_found) EXPECT_FALSE(names(found, missing.id));
  }
  EXPECT_GE(right, 9);
}

TEST(TraceTest, AnEffectOfNoLibraryIsUnknownOverWhatItDependsOn) {
  constexpr int kRuns = 10;
  int right = 0;
  for (int seed = 0; seed < kRuns; ++seed) {
    const Trace trace = trace_of(static_cast<std::uint64_t>(seed), {{0, "tanh_other", 1.0}});
    if (trace.verdict != TraceVerdict::kUnknown || trace.rest.empty()) continue;
    const Rest& rest = trace.rest.front();
    if (rest.place != "joint1" || rest.covariate != "value of joint2") continue;
    ++right;
    EXPECT_LT(rest.p_value, 0.01);
    EXPECT_EQ(rest.mean.size(), rest.at.size());
    EXPECT_LT(trace.held_out_after.value, trace.held_out_before.value);
    EXPECT_LT(trace.held_out_after.value, 1.05);  // of noise 1
  }
  EXPECT_GE(right, 9);
}

// An effect makes what is left last, and its stretches few: the four knots that they allow do not
// follow a wave.
TEST(TraceTest, TheShapeOfWhatLastsIsLookedForWithMoreKnots) {
  constexpr int kRuns = 10;
  int right = 0;
  for (int seed = 0; seed < kRuns; ++seed) {
    LinearWorldOptions options;
    options.seed = static_cast<std::uint64_t>(seed);
    options.lasts_s = 0.2;
    const auto is_found = [](const Trace& trace) {
      return trace.verdict == TraceVerdict::kUnknown && !trace.rest.empty() &&
             trace.rest.front().place == "joint1" &&
             trace.rest.front().covariate == "value of joint2";
    };
    right += is_found(trace_effects(LinearWorld(options, {{0, "wave_other", 2.0}}))) ? 1 : 0;
    EXPECT_EQ(trace_effects(LinearWorld(options, {})).verdict, TraceVerdict::kClean);
  }
  EXPECT_GE(right, 7);  // 8; none with four
}

// What the library's effect cannot imitate is a small part of what it explains; one curve says all.
TEST(TraceTest, ACurveThatSaysMoreThanAnEffectAndACurveTakesItsName) {
  constexpr int kRuns = 10;
  int unnamed = 0;
  for (int seed = 0; seed < kRuns; ++seed) {
    LinearWorldOptions options;
    options.seed = static_cast<std::uint64_t>(seed);
    options.imitates = true;
    const Trace trace = trace_effects(LinearWorld(options, {{0, "tanh_other", 4.0}}));
    if (trace.accepted.empty() && trace.verdict == TraceVerdict::kUnknown) ++unnamed;
  }
  EXPECT_GE(unnamed, 6);  // two without the comparison
}

TEST(TraceTest, AThousandthOfWhatIsNamedDoesNotMakeItUnknown) {
  const Trace slight = trace_of(1, {{0, "scale", 60.0}, {0, "tanh_other", 1.0}});
  ASSERT_FALSE(slight.rest.empty());
  EXPECT_EQ(slight.verdict, TraceVerdict::kEffects);
  EXPECT_NE(slight.reason.find("less than a thousandth"), std::string::npos) << slight.reason;
  const Trace plain = trace_of(1, {{0, "scale", 3.0}, {0, "tanh_other", 1.0}});
  EXPECT_EQ(plain.verdict, TraceVerdict::kUnknown);
}

// Waves are what any function is made of: after three at one place the rest is left as it is.
TEST(TraceTest, NamesAtMostThreeWavesAtAPlace) {
  const Trace trace = trace_of(1, {{0, "gear", 2.0, 6.0},
                                   {0, "gear", 2.0, 11.0},
                                   {0, "gear", 2.0, 17.0},
                                   {0, "gear", 2.0, 23.0},
                                   {0, "gear", 2.0, 29.0}});
  const auto waves = std::ranges::count_if(
      trace.added, [](const AddedEffect& effect) { return effect.id.effect == "gear"; });
  EXPECT_GE(waves, 1);
  EXPECT_LE(waves, 3);
}

TEST(TraceTest, TwoEffectsAtOnceAreBothFound) {
  constexpr int kRuns = 10;
  int right = 0;
  for (int seed = 0; seed < kRuns; ++seed) {
    const Trace trace =
        trace_of(static_cast<std::uint64_t>(seed), {{0, "scale", 0.5}, {1, "direction", 0.5}});
    if (trace.verdict != TraceVerdict::kEffects || trace.accepted.size() != 2) continue;
    for (const TracedEffect& effect : trace.accepted) {
      const EffectId scale{"scale", "joint1"};
      if (effect.id == scale || effect.id == EffectId{"direction", "joint2"}) {
        EXPECT_NEAR(effect.size, 0.5, 0.2);
        EXPECT_LT(effect.held_out_after.value, effect.held_out_before.value);
        right += 1;
      }
    }
  }
  EXPECT_GE(right, 2 * kRuns - 2);
}

TEST(TraceTest, TheFirstEffectIsTheOneThatExplainsMost) {
  LinearWorldOptions options;
  const LinearWorld world(options, {{0, "scale", 0.5}, {1, "direction", 0.5}});
  TraceOptions known;
  std::vector<EffectId> found;
  while (const auto first = first_effect(world, known)) {
    found.push_back(first->id);
    known.start.push_back(*first);
  }
  std::ranges::sort(found);
  EXPECT_EQ(found, (std::vector<EffectId>{{"direction", "joint2"}, {"scale", "joint1"}}));
  EXPECT_FALSE(first_effect(LinearWorld(options, {})));
}

// Below what the sensor itself errs by it is not looked for, nor is it told by the names of two
// effects that look like it together.
TEST(TraceTest, WhatIsBelowItsFloorHasNoOtherNames) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    LinearWorldOptions world;
    world.seed = seed;
    world.stands_in = true;
    const Trace trace = trace_effects(LinearWorld(world, {{0, "weave", 1.0}}));
    EXPECT_TRUE(trace.accepted.empty()) << seed << ": " << trace.accepted.front().id.effect;
  }
}

// What is too small to be looked for is named where another effect would be named in its place.
TEST(TraceTest, WhatIsBelowItsFloorIsNamedBeforeWhatStandsInForIt) {
  LinearWorldOptions options;
  options.imitates = true;
  const std::vector<Injected> small{{0, "tanh_other", 0.5, 0.0}};
  const Trace imitated = trace_effects(LinearWorld(options, small));
  EXPECT_TRUE(std::ranges::any_of(imitated.steps, [](const TraceStep& step) {
    return step.words.starts_with("imitation at joint1 added");
  })) << imitated.reason;
  options.other_is_small = true;
  const Trace named = trace_effects(LinearWorld(options, small));
  ASSERT_EQ(named.accepted.size(), 1u) << named.reason;
  EXPECT_EQ(named.accepted.front().id, (EffectId{"tanh_other", "joint1"}));
  EXPECT_EQ(named.verdict, TraceVerdict::kEffects) << named.reason;
}

TEST(TraceTest, ASearchEndsWhereItsCallerHasTheAnswer) {
  const LinearWorld world({}, {{0, "scale", 0.5, 0.0}});
  TraceOptions options;
  std::vector<AddedEffect> asked;
  options.until = [&](const std::vector<AddedEffect>& added) {
    asked = added;
    return true;
  };
  const Trace trace = trace_effects(world, options);
  EXPECT_EQ(trace.verdict, TraceVerdict::kNothingToSay);
  ASSERT_EQ(asked.size(), 1u);
  EXPECT_EQ(asked.front().id, (EffectId{"scale", "joint1"}));
  EXPECT_TRUE(trace.accepted.empty());
  options.until = [](const std::vector<AddedEffect>&) { return false; };
  EXPECT_EQ(trace_effects(world, options).verdict, TraceVerdict::kEffects);
}

TEST(TraceTest, ASearchAboutAnEffectEndsWhereThatIsTakenOut) {
  const LinearWorld world({}, {{0, "scale", 0.5, 0.0}});
  TraceOptions options;
  options.start = {{{"coupling", "joint2"}, 0.0}};
  options.about = options.start.front().id;
  EXPECT_EQ(trace_effects(world, options).verdict, TraceVerdict::kNothingToSay);
  options.start = {{{"scale", "joint1"}, 0.0}};
  options.about = options.start.front().id;
  EXPECT_EQ(trace_effects(world, options).verdict, TraceVerdict::kEffects);
}

TEST(TraceTest, AStartEffectStaysOnlyIfItEarnsItsPlace) {
  LinearWorldOptions options;
  options.seed = 4;
  TraceOptions known;
  known.start = {{{"sine", "joint2"}, 0.0}};
  const Trace idle = trace_effects(LinearWorld(options, {}), known);
  EXPECT_EQ(idle.verdict, TraceVerdict::kClean) << idle.reason;
  EXPECT_TRUE(idle.added.empty());
  EXPECT_NE(idle.steps.back().words.find("sine at joint2 removed"), std::string::npos);
  const Trace real = trace_effects(LinearWorld(options, {{1, "sine", 2.0}}), known);
  EXPECT_TRUE(only(real, {"sine", "joint2"})) << real.reason;
  // Its parameters count as an effect's: before is without it.
  EXPECT_GT(real.held_out_before.value, 1.1 * real.held_out_after.value);
}

// As where sightings that were put aside come back: what such a time leaves looks like another
// step.
TEST(TraceTest, AStartEffectsTimeIsLookedForAgain) {
  LinearWorldOptions options;
  options.seed = 4;
  constexpr double kTruth = 8.0;  // s
  TraceOptions known;
  known.start = {{{"step", "joint1"}, kTruth + 1.0}};
  const Trace trace = trace_effects(LinearWorld(options, {{0, "step", 4.0, kTruth}}), known);
  EXPECT_TRUE(only(trace, {"step", "joint1"})) << trace.reason;
  ASSERT_EQ(trace.added.size(), 1U);
  EXPECT_NEAR(trace.added.front().scan, kTruth, 0.1);
  EXPECT_EQ(trace.steps.size(), 2U);  // nothing was added or taken out
}

// Beside the others its columns are what the model can do itself; fitted, it predicts clearly
// better.
// How far it goes and how fast cannot be told apart before its time constant is over.
TEST(TraceTest, ASizeInDoubtBecauseOfItsTimeConstantIsNamedWhereItClearlyPredicts) {
  constexpr int kRuns = 50;
  constexpr double kTau_s = 20.0;  // of 13 s
  const auto traces_of = [](double size) {
    std::vector<Trace> out;
    for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
      LinearWorldOptions options;
      options.seed = seed;
      options.drifts = true;
      out.push_back(trace_effects(LinearWorld(options, {{0, "drift", size, kTau_s}})));
    }
    return out;
  };
  const auto is_named = [](const Trace& trace) { return names(trace, {"drift", "joint1"}); };
  const auto is_taken_out = [](const Trace& trace) {
    return std::ranges::any_of(trace.steps, [](const TraceStep& step) {
      return step.words == "drift at joint1 removed: its size may be nothing";
    });
  };
  const std::vector<Trace> large = traces_of(4.0);
  EXPECT_GE(std::ranges::count_if(large, is_named), kRuns - 1);
  EXPECT_EQ(std::ranges::count_if(large, is_taken_out), 0);
  // None where the doubt about the time constant was not counted in.
  const std::vector<Trace> slight = traces_of(1.4);
  EXPECT_GE(std::ranges::count_if(slight, is_taken_out), 3);
}

TEST(TraceTest, WhatOnlyTheFitShowsIsPicturedAndSizedFromTheFit) {
  LinearWorldOptions options;
  options.bends = true;
  TraceOptions known;
  known.start = {{{"bend", "joint1"}, 0.0}};
  constexpr double kSize = 1.0;
  const Trace trace = trace_effects(LinearWorld(options, {{0, "tanh_other", kSize}}), known);
  ASSERT_EQ(trace.accepted.size(), 1U) << trace.reason;
  const TracedEffect& bend = trace.accepted.front();
  EXPECT_EQ(bend.id, (EffectId{"bend", "joint1"}));
  EXPECT_LE(bend.interval.low, kSize);
  EXPECT_GE(bend.interval.high, kSize);
  // As the refit shows it; the score test alone would say 1.
  EXPECT_LT(bend.p_value, 0.03);
  ASSERT_EQ(bend.picture.effect.size(), options.instants);
  EXPECT_NEAR(bend.picture.effect.mean(), bend.size, 1e-9);
  // No linear test says that another effect does the same.
  EXPECT_TRUE(trace.ambiguities.empty());
  const Trace idle = trace_effects(LinearWorld(options, {}), known);
  EXPECT_TRUE(idle.accepted.empty());
}

TEST(TraceTest, ParametersThatCannotBeAreNotFound) {
  LinearWorldOptions options;
  const EffectId scale{"scale", "joint1"};
  EXPECT_TRUE(only(trace_effects(LinearWorld(options, {{0, "scale", -0.5, 0.0}})), scale));
  options.scale_grows = true;
  EXPECT_TRUE(only(trace_effects(LinearWorld(options, {{0, "scale", 0.5, 0.0}})), scale));
  const Trace trace = trace_effects(LinearWorld(options, {{0, "scale", -0.5, 0.0}}));
  EXPECT_NE(trace.verdict, TraceVerdict::kClean);
  EXPECT_EQ(std::ranges::find(trace.accepted, scale, &TracedEffect::id), trace.accepted.end());
}

// In a straight line the residual asks for a scale that can be; the fit ends where none is.
TEST(TraceTest, WhatCannotBeOnceItIsFittedIsNotAdded) {
  LinearWorldOptions options;
  options.scale_grows = true;
  for (const bool turns : {false, true}) {
    options.scale_turns = turns;
    const Trace trace = trace_effects(LinearWorld(options, {{0, "scale", 0.5, 0.0}}));
    const bool added = std::ranges::any_of(trace.steps, [](const TraceStep& step) {
      return step.words.starts_with("scale at joint1 added");
    });
    EXPECT_EQ(added, !turns) << trace.reason;
  }
}

// Of an effect that is not there the direction is an accident, and what its size must be to rise
// above a floor is not.
TEST(TraceTest, TheSmallestSizeAboveAFloorDoesNotDependOnTheNoise) {
  TraceOptions options;
  options.floor = 20.0;  // far above what the test itself needs
  std::vector<double> sizes;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    LinearWorldOptions world;
    world.seed = 5;
    world.noise_seed = seed;
    const Trace trace = trace_effects(LinearWorld(world, {}), options);
    const auto sine =
        std::ranges::find(trace.not_found, EffectId{"sine", "joint1"}, &NotFoundEffect::id);
    ASSERT_NE(sine, trace.not_found.end());
    sizes.push_back(sine->smallest_size);
  }
  const auto [least, most] = std::ranges::minmax(sizes);
  EXPECT_LT(most, 1.01 * least);
}

TEST(TraceTest, TooLittleToJudgeSaysNothing) {
  const Trace trace = trace_of(1, {{0, "scale", 5.0}}, 0.0, 8);
  EXPECT_EQ(trace.verdict, TraceVerdict::kNothingToSay);
  EXPECT_EQ(trace.stretches, 8);
  EXPECT_NE(trace.reason.find("record longer"), std::string::npos) << trace.reason;
  EXPECT_TRUE(trace.accepted.empty());
  LinearWorldOptions one_posture;
  one_posture.folds = 1;
  const Trace held = trace_effects(LinearWorld(one_posture, {{0, "scale", 5.0}}));
  EXPECT_EQ(held.verdict, TraceVerdict::kNothingToSay);
  EXPECT_NE(held.reason.find("postures"), std::string::npos) << held.reason;
}

TEST(TraceTest, WhatTheModelNeedsToConvergeIsFound) {
  LinearWorldOptions options;
  options.converges_with = "gear";
  const Trace found = trace_effects(LinearWorld(options, {{0, "gear", 0.5, 17.0}}));
  EXPECT_TRUE(only(found, {"gear", "joint1"}));
  EXPECT_TRUE(found.converged);
  const Trace none = trace_effects(LinearWorld(options, {}));
  EXPECT_EQ(none.verdict, TraceVerdict::kNothingToSay);
  EXPECT_FALSE(none.converged);
  EXPECT_TRUE(none.accepted.empty());
  EXPECT_NE(none.reason.find("iterations"), std::string::npos) << none.reason;
}

// The noise is 1 and two of 1600 rows' freedom are spent: unseen rows have an error of 1.
TEST(TraceTest, HeldOutIntervalsCoverTheNoise) {
  constexpr int kRuns = 60;
  int covered = 0;
  for (int seed = 0; seed < kRuns; ++seed) {
    const HeldOutError error = trace_of(500 + static_cast<std::uint64_t>(seed), {}).held_out_after;
    EXPECT_LT(error.interval.high - error.interval.low, 0.2);
    if (error.interval.low <= 1.0 && 1.0 <= error.interval.high) ++covered;
  }
  // 95 % of 60: fewer than 52 would be a chance of 4e-3.
  EXPECT_GE(covered, 52);
}

}  // namespace
}  // namespace kinescope
