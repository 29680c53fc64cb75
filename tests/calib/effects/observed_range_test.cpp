// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/observed_range.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace kinescope {
namespace {

constexpr JointLimits kObservedRange{-0.8, 1.7};
constexpr double kFadeReach = kFadeShare * (kObservedRange.upper - kObservedRange.lower);

FittedEffect effect_over(const std::string& effect, std::optional<JointLimits> range,
                         double scan = 0.0) {
  FittedEffect out;
  out.id = {effect, "q1"};
  out.scan = scan;
  out.range = range;
  return out;
}

KinematicTree two_joints() {
  KinematicTree tree;
  tree.joints.resize(2);
  tree.joints[0].name = "q1";
  tree.joints[0].limits = JointLimits{-1.0, 2.0};
  tree.joints[1].name = "q2";
  tree.joints[1].limits = kObservedRange;
  return tree;
}

TEST(ObservedRange, IsThatOfTheJointAnEffectDependsOn) {
  const KinematicTree tree = two_joints();
  for (const char* effect : {"encoder_scale", "eccentricity", "gear_error", "backlash",
                             "compliance", "helical", "curved_slider", "axis_wobble", "joint_map"})
    EXPECT_EQ(observed_range(effect_over(effect, {}), tree), tree.joints[0].limits) << effect;
  EXPECT_EQ(observed_range(effect_over("coupling", {}, 1.0), tree), kObservedRange);
  EXPECT_EQ(observed_range(effect_over("coupling", {}, 2.0), tree), std::nullopt);
  for (const char* effect : {"time_offset", "zero_jump", "zero_drift"})
    EXPECT_EQ(observed_range(effect_over(effect, {}), tree), std::nullopt) << effect;
}

TEST(RangeWeight, IsOneWithinAndFallsToNothingWithoutAStep) {
  const FittedEffect gear = effect_over("gear_error", kObservedRange, 30.0);
  for (const double value : {kObservedRange.lower, -0.1, 1.0, kObservedRange.upper})
    EXPECT_EQ(range_weight(gear, value), 1.0);
  constexpr int kSteps = 1000;
  constexpr double kSteepest = 1.5;  // of a cubic from 1 to 0
  double last = 1.0;
  for (int i = 1; i <= kSteps; ++i) {
    const double distance = kFadeReach * i / kSteps;
    const double weight = range_weight(gear, kObservedRange.upper + distance);
    EXPECT_LE(weight, last);
    EXPECT_LT(last - weight, 1.01 * kSteepest / kSteps);
    EXPECT_NEAR(weight, range_weight(gear, kObservedRange.lower - distance), 1e-12);
    last = weight;
  }
  EXPECT_EQ(range_weight(gear, kObservedRange.upper + 1.0001 * kFadeReach), 0.0);
  EXPECT_EQ(range_weight(gear, -40.0), 0.0);
}

TEST(RangeWeight, OfAnEffectWithoutARangeIsOneAnywhere) {
  EXPECT_EQ(range_weight(effect_over("encoder_scale", {}), 40.0), 1.0);
  EXPECT_EQ(beyond_range(effect_over("encoder_scale", {}), 40.0), 0.0);
}

TEST(RangeWeight, OfAJointThatRestedIsNothingElsewhere) {
  const FittedEffect scale = effect_over("encoder_scale", JointLimits{0.3, 0.3});
  EXPECT_EQ(range_weight(scale, 0.3), 1.0);
  EXPECT_EQ(range_weight(scale, 0.31), 0.0);
}

TEST(RangeWeight, OfWhatRepeatsEveryTurnIsThatOfTheSameAngle) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const FittedEffect ring = effect_over("eccentricity", kObservedRange, 1.0);
  const FittedEffect gear = effect_over("gear_error", kObservedRange, 30.0);
  EXPECT_EQ(range_weight(ring, 1.0 + kTurn), 1.0);
  EXPECT_EQ(range_weight(gear, 1.0 + kTurn), 0.0);
  EXPECT_NEAR(beyond_range(ring, kObservedRange.upper + 0.1), 0.1, 1e-12);
  EXPECT_NEAR(beyond_range(ring, kObservedRange.lower - kTurn - 0.1), 0.1, 1e-12);
  const FittedEffect whole = effect_over("eccentricity", JointLimits{-3.5, 3.5}, 1.0);
  for (double value = -20.0; value < 20.0; value += 0.1)
    EXPECT_EQ(range_weight(whole, value), 1.0) << value;
}

}  // namespace
}  // namespace kinescope
