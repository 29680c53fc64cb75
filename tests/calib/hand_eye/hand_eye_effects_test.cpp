// SPDX-License-Identifier: Apache-2.0
//
// What stands beside the hand-eye equation: found, sized, and not invented.
#include <algorithm>

#include <gtest/gtest.h>

#include "calib/hand_eye/hand_eye.h"
#include "tests/truth/hand_eye_world.h"

namespace kinescope {
namespace {

using truth::HandEyeWorldOptions;
using truth::make_hand_eye_world;

const TracedEffect* effect_in(const HandEye& result, std::string_view name) {
  const auto found = std::ranges::find_if(
      result.trace->accepted, [&](const TracedEffect& e) { return e.id.effect == name; });
  return found == result.trace->accepted.end() ? nullptr : &*found;
}

HandEye traced(const HandEyeWorldOptions& options) {
  HandEye out = calibrate_hand_eye(make_hand_eye_world(options).input);
  EXPECT_TRUE(out.trace.has_value());
  return out;
}

// Of so many worlds, in how many the effect is found and its interval holds the truth.
struct Tally {
  int found = 0;
  int covered = 0;
  int others = 0;
};

Tally tally(HandEyeWorldOptions options, std::string_view name, double truth, int worlds) {
  Tally out;
  for (int k = 1; k <= worlds; ++k) {
    options.seed = static_cast<std::uint64_t>(k);
    const HandEye result = traced(options);
    out.others += static_cast<int>(std::ranges::count_if(
        result.trace->accepted, [&](const TracedEffect& e) { return e.id.effect != name; }));
    const TracedEffect* effect = effect_in(result, name);
    if (effect == nullptr) continue;
    ++out.found;
    if (effect->interval.low <= truth && truth <= effect->interval.high) ++out.covered;
    EXPECT_LT(effect->held_out_after.value, effect->held_out_before.value);
  }
  return out;
}

constexpr int kEffectWorlds = 20;

TEST(HandEyeEffects, ScaleIsFoundAndSized) {
  HandEyeWorldOptions options;
  options.poses = 30;
  options.scale = 0.01;  // over a way of 0.2 m: 2 mm, where poses err by 0.3
  // The controller's positions are to be made longer by 1 / (1 - scale).
  const Tally out = tally(options, "position_scale", 1.0 / (1.0 - 0.01) - 1.0, kEffectWorlds);
  EXPECT_EQ(out.found, kEffectWorlds);
  EXPECT_GE(out.covered, kEffectWorlds - 4);
  EXPECT_LE(out.others, 1);
}

TEST(HandEyeEffects, ABumpIsFoundWhereItWas) {
  for (const CameraMount mount : {CameraMount::kOnHand, CameraMount::kFixed}) {
    HandEyeWorldOptions options;
    options.mount = mount;
    options.poses = 30;
    options.bump_m = 0.004;
    const HandEye result = traced(options);
    const TracedEffect* bump = effect_in(result, "camera_bump");
    ASSERT_NE(bump, nullptr);
    EXPECT_EQ(bump->scan, 15.0);
    EXPECT_NEAR(bump->size, 0.004, 0.0015);
    EXPECT_LT(result.trace->held_out_after.value, 0.8 * result.trace->held_out_before.value);
  }
}

TEST(HandEyeEffects, ALagIsFoundAndSized) {
  HandEyeWorldOptions options;
  options.motion = true;
  options.poses = 300;
  options.lag_s = 0.04;
  // Rows of one motion tremble by microns; what controllers err by lasts.
  options.flange_sigma_m = 1e-5;
  options.flange_sigma_rad = 2e-5;
  const Tally out = tally(options, "time_offset", 0.04, 5);
  EXPECT_EQ(out.found, 5);
  EXPECT_GE(out.covered, 4);
  EXPECT_EQ(out.others, 0) << "clocks that do not run apart";
}

// A tracker and a camera that see one body, each by its own clock.
TEST(HandEyeEffects, TwoClocksThatRunApartAreFoundAndSized) {
  HandEyeWorldOptions options;
  options.motion = true;
  options.mount = CameraMount::kFixed;
  options.corners = false;
  options.poses = 600;
  options.lag_s = 0.04;
  options.drift = 2e-3;  // over 20 s as much as the lag
  options.flange_sigma_m = 1e-5;
  options.flange_sigma_rad = 2e-5;
  int covered = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
    options.seed = seed;
    const HandEye result = traced(options);
    const TracedEffect* drift = effect_in(result, "clock_drift");
    const TracedEffect* lag = effect_in(result, "time_offset");
    ASSERT_NE(drift, nullptr) << seed;
    ASSERT_NE(lag, nullptr) << seed;
    EXPECT_EQ(result.trace->accepted.size(), 2U) << seed;
    EXPECT_NEAR(drift->size, options.drift, 0.1 * options.drift);
    EXPECT_NEAR(lag->size, options.lag_s, 2e-3);
    if (drift->interval.low <= options.drift && options.drift <= drift->interval.high) ++covered;
  }
  EXPECT_GE(covered, 4);
}

TEST(HandEyeEffects, NothingIsInvented) {
  HandEyeWorldOptions options;
  options.poses = 25;
  const Tally out = tally(options, "none", 0.0, 2 * kEffectWorlds);
  // One in a hundred is the declared rate.
  EXPECT_LE(out.others, 2);
}

}  // namespace
}  // namespace kinescope
