// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include "calib/bundle/effect_bundle.h"
#include "calib/effects/corrected_log.h"
#include "calib/effects/trace_calibration.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "tests/calib/effects/traced_worlds.h"

namespace kinescope {
namespace {

using truth::EffectWorldOptions;
using truth::InjectedEffect;
using truth::make_effect_world;
using truth::World;

// The last joint's errors are those of one marker: a quarter of its sightings stands out, at either
// end of the joint's range. A part of a wave would explain the same; it need not be so straight.
TEST(TraceCalibration, WhatStandsOutAtTheEndsOfAJointsRangeIsItsScale) {
  constexpr double kScale = 0.025;
  const World world =
      tracked(truth::RobotKind::kPlanar, 150, {{"encoder_scale", "q4", kScale, 0.0}});
  const Trace trace = trace_of(world).trace;
  ASSERT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"encoder_scale", "q4"})) << answer(trace);
  EXPECT_TRUE(size_is_right(trace.accepted.front(), kScale)) << trace.accepted.front().size;
}

// Without the effect those are left out whose noise adds to it; the others seem to follow a curve.
TEST(TraceCalibration, SightingsAreChosenAgainBesideTheEffect) {
  for (const double scale : {0.02, 0.025, 0.03}) {
    const World world =
        tracked(truth::RobotKind::kWrist, 90, {{"encoder_scale", "q1", scale, 0.0}});
    const CalibrationTrace found = trace_of(world);
    EXPECT_EQ(found.trace.verdict, TraceVerdict::kEffects) << answer(found.trace);
    CalibrationStart start = start_of(world);
    const EffectBundle without(world.measurements, world.markers, world.log, start, {});
    start.corrections = found.corrections;
    const EffectBundle beside(world.measurements, world.markers, world.log, start, {});
    EXPECT_FALSE(beside.chose_as(without)) << scale;
    EXPECT_NEAR(found.trace.accepted.front().size, scale, 0.01 * scale);
  }
}

// An effect of a few times the noise: what stood out from the fit without it were the sightings
// whose noise adds to it, and its size came out 1 to 3 % too small in every recording.
TEST(TraceCalibration, SizesScatterAboutTheTruth) {
  constexpr int kNoises = 12;
  constexpr double kSize = 0.0055;  // rad
  double sum = 0.0;
  int held = 0;
  for (int noise = 0; noise < kNoises; ++noise) {
    const Trace trace =
        trace_of(tracked(truth::RobotKind::kScara, 180, {{"gear_error", "q4", kSize, 40.0}},
                         static_cast<std::uint64_t>(noise)))
            .trace;
    ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
    const TracedEffect& gear = trace.accepted.front();
    EXPECT_EQ(gear.id, (EffectId{"gear_error", "q4"}));
    const double half = 0.5 * (gear.interval.high - gear.interval.low);
    sum += 2.0 * (gear.size - kSize) / half;
    held += std::abs(gear.size - kSize) < half ? 1 : 0;
  }
  // Three standard deviations of a mean; 95 % intervals.
  EXPECT_LT(std::abs(sum / kNoises), 3.0 / std::sqrt(kNoises));
  EXPECT_GE(held, kNoises - 2);
}

// A curve over neither joint shows what two do together.
TEST(TraceCalibration, WhatTwoJointsDoTogetherIsUnknownOverTheirProduct) {
  const World world =
      tracked(truth::RobotKind::kScara, 100, {{"own_product", "q2", 0.01, 0.0, "q4"}});
  const Trace trace = trace_of(world).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kUnknown) << answer(trace);
  // What it explains is not counted again for another curve that explains nothing.
  ASSERT_EQ(trace.rest.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.rest.front().place, "q2");
  EXPECT_EQ(trace.rest.front().covariate, "value of q2 times value of q4");
}

// Joints read a moment after each move, when the robot still had a part of the way to go to where
// it was sent: the log's columns, and beside them the commands.
World read_early(World world, double share) {
  constexpr double kLeft = 0.005;  // rad or m, of the way
  Rng rng = Rng::from_name("EarlyReading");
  JointLog& log = world.log;
  const Eigen::Index joints = log.values.cols();
  log.values.conservativeResize(Eigen::NoChange, 2 * joints);
  for (Eigen::Index j = 0; j < joints; ++j) {
    log.channels.push_back(log.channels[static_cast<std::size_t>(j)] + "_cmd");
    for (Eigen::Index i = 0; i < log.values.rows(); ++i) {
      const double left = rng.normal(kLeft);
      log.values(i, j) -= share * left;
      log.values(i, joints + j) = log.values(i, j) + left;
    }
    world.tree.joints[static_cast<std::size_t>(j)].copies = {log.channels.back()};
  }
  return world;
}

CalibrationTrace trace_of_read_early(const World& world) {
  CalibrationStart start = start_of(world);
  for (std::size_t j = 0; j < start.tree.joints.size(); ++j)
    start.tree.joints[j].copies = world.tree.joints[j].copies;
  return trace_calibration(world.measurements, world.markers, world.log, start, {});
}

TEST(TracePostures, JointsThatAreReadBeforeTheyRestStandNearerToTheirCommand) {
  constexpr double kShare = 0.7;
  const World world = read_early(tracked(truth::RobotKind::kScara, 100, {}), kShare);
  const CalibrationTrace found = trace_of_read_early(world);
  EXPECT_EQ(found.trace.verdict, TraceVerdict::kEffects) << answer(found.trace);
  ASSERT_EQ(found.trace.accepted.size(), world.tree.joints.size()) << answer(found.trace);
  for (const TracedEffect& effect : found.trace.accepted) {
    EXPECT_EQ(effect.id.effect, "early_reading");
    EXPECT_EQ(effect.scan_words, effect.id.place + "_cmd");
    EXPECT_NEAR(effect.size, kShare, 0.03) << effect.id.place;
  }
  // Undone, the log says where the joints stood.
  const CorrectedLog corrected = corrected_log(world.log, world.tree, found.effects, std::nullopt);
  const World truth = tracked(truth::RobotKind::kScara, 100, {});
  const Eigen::Index joints = truth.log.values.cols();
  const Eigen::MatrixXd left = corrected.log.values.leftCols(joints) - truth.log.values;
  EXPECT_LT(left.cwiseAbs().maxCoeff(), 5e-4);
  EXPECT_GT((world.log.values.leftCols(joints) - truth.log.values).cwiseAbs().maxCoeff(), 5e-3);
}

TEST(TracePostures, CommandsSayNothingWhereReadingsAreRight) {
  const World world = read_early(tracked(truth::RobotKind::kScara, 100, {}), 0.0);
  const Trace trace = trace_of_read_early(world).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kClean) << answer(trace);
}

// Where the log to be corrected lacks the commands.
TEST(TracePostures, WithoutCommandsAnEarlyReadingIsNotUndone) {
  World world = read_early(tracked(truth::RobotKind::kScara, 100, {}), 0.7);
  const CalibrationTrace found = trace_of_read_early(world);
  world.log.channels.resize(world.log.channels.size() / 2);
  world.log.values.conservativeResize(Eigen::NoChange, world.log.values.cols() / 2);
  EXPECT_THROW((void)corrected_log(world.log, world.tree, found.effects, std::nullopt), Error);
}

// A joint with play stands short of its reading, on the side that it came from.
TEST(TracePostures, TheOrderOfPosturesTellsFromWhichSideAJointCame) {
  constexpr double kWidth = 0.004;  // rad
  const World clean = tracked(truth::RobotKind::kScara, 100, {});
  World world = clean;
  for (Eigen::Index i = 0; i < world.log.values.rows(); ++i) {
    const double from = i > 0 ? clean.log.values(i - 1, 1) : clean.log.values(i, 1) - kWidth;
    world.log.values(i, 1) += std::copysign(0.5 * kWidth, clean.log.values(i, 1) - from);
  }
  const CalibrationTrace found = trace_of(world);
  EXPECT_EQ(found.trace.verdict, TraceVerdict::kEffects) << answer(found.trace);
  ASSERT_EQ(found.trace.accepted.size(), 1U) << answer(found.trace);
  EXPECT_EQ(found.trace.accepted.front().id, (EffectId{"backlash", "q2"}));
  EXPECT_TRUE(size_is_right(found.trace.accepted.front(), kWidth));
  const CorrectedLog corrected = corrected_log(world.log, world.tree, found.effects, std::nullopt);
  EXPECT_LT((corrected.log.values - clean.log.values).cwiseAbs().maxCoeff(), 0.1 * kWidth);
}

}  // namespace
}  // namespace kinescope
