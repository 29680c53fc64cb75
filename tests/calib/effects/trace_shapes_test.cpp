// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "calib/bundle/effect_bundle.h"
#include "calib/effects/corrected_log.h"
#include "calib/effects/gravity_by_sag.h"
#include "calib/effects/trace_calibration.h"
#include "kinematics/core/error.h"
#include "tests/calib/effects/traced_worlds.h"

namespace kinescope {
namespace {

using truth::EffectWorldOptions;
using truth::InjectedEffect;
using truth::make_effect_world;
using truth::World;

TEST(TraceCalibration, AnEffectOfNoLibraryIsUnknownAtItsJoint) {
  const Trace trace = trace_of(make_effect_world(filmed({strong("own_tanh", "q2")}))).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kUnknown) << answer(trace);
  ASSERT_FALSE(trace.rest.empty());
  EXPECT_EQ(trace.rest.front().place, "q2");
}

// An error of no known shape that repeats with the joint's value is no riddle to who uses the
// robot: it is measured, said over which range, and undone.
TEST(TraceCalibration, WhatRepeatsWithAJointsValueIsAMapOfIt) {
  constexpr double kStep = 0.01;  // rad, of a smooth step about 0
  const World world = make_effect_world(filmed({{"own_tanh", "q2", kStep, 0.0, "q2"}}, 400));
  const CalibrationTrace found = trace_of(world);
  const Trace& trace = found.trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kUnknown) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  const TracedEffect& map = trace.accepted.front();
  EXPECT_EQ(map.id, (EffectId{"joint_map", "q2"}));
  EXPECT_LT(map.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
  EXPECT_GT(map.held_out_before.value, 3.0 * map.held_out_after.value);

  ASSERT_EQ(found.effects.size(), 1U);
  const ErrorTable& table = found.effects.front().table;
  const CorrectedLog corrected = corrected_log(world.log, world.tree, found.effects, std::nullopt);
  ASSERT_EQ(corrected.undone.size(), 1U);
  const int channel = value_of(world.log.channel("q2"));
  const Eigen::VectorXd logged = world.log.values.col(channel);
  const double reach = logged.cwiseAbs().maxCoeff();
  const Eigen::ArrayXd truth = kStep * (5.0 * logged.array() / reach).tanh();
  const Eigen::ArrayXd undone = corrected.log.values.col(channel) - logged;
  // A constant is the joint's zero, and a slope nearly the links' lengths.
  Eigen::MatrixXd line(logged.size(), 2);
  line << Eigen::VectorXd::Ones(logged.size()), logged;
  const Eigen::VectorXd miss = (undone - truth).matrix();
  const Eigen::VectorXd left = miss - line * line.colPivHouseholderQr().solve(miss);
  EXPECT_LT(left.cwiseAbs().maxCoeff(), 0.05 * kStep);

  // Beyond what was seen it says nothing.
  EXPECT_EQ(table.at(Eigen::VectorXd::Constant(1, 10.0))[0], 0.0);
  EXPECT_EQ(table.at(Eigen::VectorXd::Constant(1, -10.0))[0], 0.0);
}

// Over a part of a turn it is a sine of many times its size and a scale that takes most of it back.
TEST(TraceCalibration, ACubicIsAMapAndNoEffectsThatCancel) {
  constexpr double kSize = 0.02;  // rad, at the end of the reach
  const World world = make_effect_world(filmed({{"own_cubic", "q2", kSize}}, 400));
  const Trace trace = trace_of(world).trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  const TracedEffect& map = trace.accepted.front();
  EXPECT_EQ(map.id, (EffectId{"joint_map", "q2"}));
  EXPECT_LT(map.size, 1.5 * kSize);
  EXPECT_LT(map.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
}

// A tripod on a floor that shakes: no joint vibrates.
TEST(TraceCalibration, ACameraThatSwaysIsNoJoint) {
  constexpr double kSize = 1e-3;  // rad
  const World world = make_effect_world(filmed({{"own_sway", "camera", kSize, 1.7}}, 400));
  const Trace trace = trace_of(world).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kUnknown) << answer(trace);
  EXPECT_TRUE(trace.accepted.empty()) << answer(trace);
  ASSERT_FALSE(trace.rest.empty());
  for (const Rest& rest : trace.rest) {
    EXPECT_TRUE(rest.place.starts_with("camera-to-base pose about ")) << rest.place;
    EXPECT_EQ(rest.covariate, "phase of a vibration of 1.7 Hz");
  }
}

// Autofocus: no joint, and no camera that moves.
TEST(TraceCalibration, AFocusThatHuntsIsNoJoint) {
  constexpr double kSize = 5e-3;
  constexpr double kTurns = 6.0;  // in the recording
  EffectWorldOptions options = filmed({}, 400);
  const double length_s = options.frames / options.frame_rate_hz;
  options.effects = {{"own_hunting", "camera", kSize, kTurns / length_s}};
  const Trace trace = trace_of(make_effect_world(options)).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kUnknown) << answer(trace);
  EXPECT_TRUE(trace.accepted.empty()) << answer(trace);
  ASSERT_FALSE(trace.rest.empty());
  EXPECT_EQ(trace.rest.front().place, "camera focal length");
}

TEST(TraceCalibration, GravityIsToldBesideACurve) {
  const World world = make_effect_world(filmed({strong("compliance", "q2")}));
  CalibrationTraceOptions options;
  const EffectBundle bundle(world.measurements, world.markers, world.log, start_of(world), {});
  const effects::TracedBundle model(bundle, options);
  constexpr double kSmoothOver = 1.0;  // rad
  constexpr double kSpread = 1e-3;     // rad
  const effects::GravityBySag told = effects::gravity_by_sag(
      model, {{{"joint_map", "q1"}, kSmoothOver, kSpread}}, {"compliance", "q2"});
  EXPECT_NEAR(told.direction.norm(), 1.0, 1e-12);
  EXPECT_GT(told.explained, 0.0);
}

// Two cameras whose clocks differ by more than the search allows led a fit there.
TEST(EffectBundle, HasTheWholeLogForAClockThatRanOff) {
  const World world = truth::make_world({});
  const EffectBundle bundle(world.measurements, world.markers, world.log, start_of(world), {});
  const double beyond_s = 1e3;
  for (const double offset_s : {beyond_s, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_EQ(bundle.motion_of_log(offset_s).times_s.size(), world.log.size());
  EXPECT_LE(bundle.motion_of_log(0.0).times_s.size(), world.log.size());
}

// Where another model ended, a change may begin with a marker behind the camera.
TEST(EffectBundle, BeginsAnewWhereAStartPredictsNothing) {
  const World world = make_effect_world(filmed({}, 60));
  const EffectBundle bundle(world.measurements, world.markers, world.log, start_of(world), {});
  const double plain = bundle.solve({}).variance;
  Correction jump;
  jump.name = "camera jump";
  jump.block = "camera";
  jump.unit = "m";
  jump.part = CorrectedPart::kCamera;
  jump.direction[5] = 1.0;
  const auto frames = static_cast<Eigen::Index>(world.measurements.times_s.size());
  jump.share = Eigen::VectorXd::LinSpaced(frames, 0.0, 1.0).array().round();
  for (const double far : {-100.0, 100.0}) {  // m
    jump.value = far;
    const BundleFit fit = bundle.fit({{jump}, false, {}}, {});
    EXPECT_TRUE(fit.residual.allFinite());
    if (fit.variance > 2.0 * plain) continue;  // the far side has a minimum of its own
    EXPECT_NEAR(fit.values[0], 0.0, 1e-3);
  }
}

// Named shapes are not taken for maps, nor maps invented beside them.
TEST(TraceCalibration, AWaveWithANameIsNoMap) {
  const Trace trace = trace_of(make_effect_world(filmed({strong("eccentricity", "q2")}))).trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"eccentricity", "q2"}));
  EXPECT_FALSE(trace.accepted.front().is_curve());
}

// At the place seen, a corner's error would be explained by itself, held out or not.
TEST(TraceCalibration, APlaceInTheImageIsWhereTheCornerIsExpected) {
  const auto places_of = [](double sigma_px) {
    EffectWorldOptions options = filmed({}, 60);
    options.sigma_px = sigma_px;
    const World world = make_effect_world(options);
    const EffectBundle bundle(world.measurements, world.markers, world.log, start_of(world), {});
    return bundle.fit({}, {}).place_px;
  };
  // The same errors, of two sizes.
  constexpr double kCornerNoise = 0.5;  // px
  const Eigen::MatrixX2d once = places_of(kCornerNoise);
  const Eigen::MatrixX2d twice = places_of(2.0 * kCornerNoise);
  ASSERT_EQ(once.rows(), twice.rows());
  double sum = 0.0;
  int count = 0;
  for (Eigen::Index row = 0; row < once.rows(); ++row) {
    if (!once.row(row).allFinite()) continue;
    sum += (once.row(row) - twice.row(row)).squaredNorm();
    count += 2;
  }
  ASSERT_GT(count, 1000);
  EXPECT_LT(std::sqrt(sum / count), 0.3 * kCornerNoise);
}

TEST(TraceCalibration, AShiftByPlaceIsUnknownOverThePlaceInTheImage) {
  InjectedEffect chequer = strong("own_chequer", "camera");
  chequer.detail = 90.0;  // px, a field
  const Trace trace = trace_of(make_effect_world(filmed({chequer}))).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kUnknown) << answer(trace);
  EXPECT_TRUE(trace.accepted.empty()) << answer(trace);
  ASSERT_EQ(trace.rest.size(), 1U);
  EXPECT_EQ(trace.rest.front().place, "camera");
  EXPECT_EQ(trace.rest.front().covariate, "place in the image");
  EXPECT_TRUE(trace.rest.front().is_field());
  EXPECT_LT(trace.held_out_after.value, 0.9 * trace.held_out_before.value);
}

}  // namespace
}  // namespace kinescope
