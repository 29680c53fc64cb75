// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/trace_calibration.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "calib/bundle/effect_bundle.h"
#include "calib/effects/corrected_log.h"
#include "calib/effects/coupling_by_design.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"
#include "kinematics/model/kinematic_tree.h"
#include "tests/calib/effects/traced_worlds.h"

namespace kinescope {
namespace {

using truth::EffectWorldOptions;
using truth::InjectedEffect;
using truth::make_effect_world;
using truth::World;

// Of 6000 coordinates' rms: 1 % by chance, parameters that were fitted, sightings left out.
constexpr double kSigmaTolerance = 0.0015;

class Named : public ::testing::TestWithParam<std::pair<std::string, std::string>> {};

TEST_P(Named, SizedAndCorrected) {
  const auto& [effect, place] = GetParam();
  const InjectedEffect injected = strong(effect, place);
  const World world = make_effect_world(filmed({injected}));
  const CalibrationTrace found = trace_of(world);
  const Trace& trace = found.trace;
  ASSERT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{effect, place})) << answer(trace);
  EXPECT_TRUE(size_is_right(trace.accepted.front(), injected.size))
      << trace.accepted.front().size << " for " << injected.size;
  EXPECT_LT(trace.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
  EXPECT_GT(trace.held_out_before.value, 1.1 * trace.held_out_after.value);
  // What goes on to the calibration and to the log says the same, and leaves only noise.
  ASSERT_EQ(found.effects.size(), 1U);
  EXPECT_EQ(found.effects.front().id, trace.accepted.front().id);
  EXPECT_EQ(std::ranges::count(found.corrections, false, &Correction::is_nuisance),
            std::ssize(found.effects.front().parameters));
  CalibrationStart start = start_of(world);
  start.corrections = found.corrections;
  const Calibration corrected =
      calibrate(world.measurements, world.markers, world.log, start, {.folds = 0});
  EXPECT_NEAR(corrected.final_rms, std::numbers::sqrt2 * kSigma, kSigmaTolerance);
}

INSTANTIATE_TEST_SUITE_P(
    TraceCalibration, Named,
    ::testing::Values(std::pair{"eccentricity", "q2"}, std::pair{"backlash", "q3"},
                      std::pair{"tag_slip", "tag_12"}, std::pair{"camera_bump", "camera"},
                      std::pair{"clock_drift", "clock"}, std::pair{"time_offset", "q2"},
                      std::pair{"camera_drift", "camera"}, std::pair{"clock_jump", "clock"},
                      std::pair{"focal_jump", "camera"}, std::pair{"focal_drift", "camera"},
                      std::pair{"thermal_growth", "robot"}, std::pair{"blooming", "camera"},
                      std::pair{"zero_jump", "q2"}, std::pair{"zero_drift", "q3"},
                      std::pair{"intrinsics", "camera focal length"},
                      std::pair{"intrinsics", "camera centre"}, std::pair{"bent_tag", "tag_13"}),
    [](const auto& tested) {
      std::string name = tested.param.first;
      if (name == "intrinsics") name += tested.param.second;
      std::erase(name, ' ');
      return name;
    });

// What is left beside play has a kink wherever its gap is as wide as a reversal.
TEST(TraceCalibration, PlayIsAsWideAsItsGap) {
  constexpr double kSame = 5e-4;
  for (const double width : {0.011, 0.017, 0.029, 0.043}) {
    const Trace trace = trace_of(make_effect_world(filmed({{"backlash", "q3", width}}, 300))).trace;
    ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
    const TracedEffect& play = trace.accepted.front();
    EXPECT_EQ(play.id, (EffectId{"backlash", "q3"})) << answer(trace);
    EXPECT_NEAR(play.scan, play.size, kSame * width);
    EXPECT_TRUE(size_is_right(play, width)) << play.size << " for " << width;
  }
}

// It rests at first, somewhere in its gap, and the drive comes to push it by and by. That was told
// as play and a jump of the zero, or as play or a late reading.
TEST(TraceCalibration, WherePlayBeganIsPartOfIt) {
  const InjectedEffect play{"backlash", "q2", 0.05};
  for (const std::uint64_t seed : {1U, 2U}) {
    EffectWorldOptions options = filmed({play}, 200);
    options.rest_s = 1.5;
    options.seed = seed;
    const Trace trace = trace_of(make_effect_world(options)).trace;
    EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
    ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
    EXPECT_EQ(trace.accepted.front().id, (EffectId{play.effect, play.place})) << answer(trace);
    EXPECT_TRUE(size_is_right(trace.accepted.front(), play.size)) << trace.accepted.front().size;
  }
}

// Of 24 mm, seen from sides that change: by more than the noise from frame to frame.
TEST(TraceCalibration, ALargeSlipKeepsItsSightings) {
  EffectWorldOptions options = filmed({{"tag_slip", "tag_16", 0.024, 0.75}}, 480);
  options.kind = truth::RobotKind::kArm6;
  options.frame_rate_hz = 30.0;
  options.amplitude_rad = 1.3;
  const Trace trace = trace_of(make_effect_world(options)).trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"tag_slip", "tag_16"})) << answer(trace);
  EXPECT_TRUE(size_is_right(trace.accepted.front(), 0.024)) << trace.accepted.front().size;
  EXPECT_LT(trace.held_out_after.value, 0.05);
}

// Steps of 0.6 deg. Where the joint turns back inside a step nobody knows how far it went.
TEST(TraceCalibration, StepsOfAReadingAreTakenOutOfIt) {
  const InjectedEffect steps = strong("quantisation", "q2");
  const World world = make_effect_world(filmed({steps}));
  const CalibrationTrace found = trace_of(world);
  const Trace& trace = found.trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"quantisation", "q2"})) << answer(trace);
  EXPECT_TRUE(size_is_right(trace.accepted.front(), steps.size)) << trace.accepted.front().size;
  EXPECT_LT(trace.held_out_after.value, 1.1 * clean_trace().trace.held_out_after.value);
  EXPECT_GT(trace.held_out_before.value, 2.0 * trace.held_out_after.value);
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
}

// For two seconds the reading says no more than in which step the joint is.
TEST(TraceCalibration, WhereAJointRestsInAStepOfItsReadingIsNoJump) {
  EffectWorldOptions options = filmed({strong("quantisation", "q2")}, 300);
  options.rest_s = 2.0;
  const Trace trace = trace_of(make_effect_world(options)).trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"quantisation", "q2"})) << answer(trace);
  EXPECT_LT(trace.held_out_after.value, 1.3 * clean_trace().trace.held_out_after.value);
}

// Steps of 3 deg: between two edges the camera alone says where the joint is, and what it says is
// neither a slip nor a jump nor structure of another kind.
TEST(TraceCalibration, CoarseStepsHideNoOtherEffectAndLookLikeNone) {
  constexpr double kCoarse = 0.05;  // rad
  EffectWorldOptions options =
      filmed({{"quantisation", "q2", kCoarse, 0.0}, strong("tag_size", "tag_12")}, 300);
  options.rest_s = 2.0;
  const Trace trace = trace_of(make_effect_world(options)).trace;
  ASSERT_EQ(trace.accepted.size(), 2U) << answer(trace);
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  for (const EffectId& id : {EffectId{"quantisation", "q2"}, EffectId{"tag_size", "tag_12"}}) {
    EXPECT_NE(std::ranges::find(trace.accepted, id, &TracedEffect::id), trace.accepted.end())
        << answer(trace);
  }
}

// What a step does from one frame to the next is no noise of the camera's.
TEST(TraceCalibration, SightingsWeighNoLessBesideReadingsInSteps) {
  const World clean = make_effect_world(filmed());
  const World stepping = make_effect_world(filmed({strong("quantisation", "q2")}));
  const EffectBundle without(clean.measurements, clean.markers, clean.log, start_of(clean), {});
  const EffectBundle with(stepping.measurements, stepping.markers, stepping.log, start_of(stepping),
                          {});
  EXPECT_LT(without.finer_than(with), 1.3);
}

// A clock that is 60 ms ahead at the end tells another reading for the frame, in another step.
TEST(TraceCalibration, WhichStepAReadingIsInIsToldByTheClockThatIsFound) {
  const InjectedEffect steps = strong("quantisation", "q2");
  const World world = make_effect_world(filmed({{"clock_drift", "clock", 0.002, 0.5}, steps}, 300));
  const Trace trace = trace_of(world).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 2U) << answer(trace);
  EXPECT_EQ(trace.accepted[0].id, (EffectId{"quantisation", "q2"}));
  EXPECT_TRUE(size_is_right(trace.accepted[0], steps.size)) << trace.accepted[0].size;
  EXPECT_EQ(trace.accepted[1].id, (EffectId{"clock_drift", "clock"}));
  EXPECT_LT(trace.held_out_after.value, 1.3 * clean_trace().trace.held_out_after.value);
}

// Bent by a twentieth of its size a marker is a hundredth shorter one way: no size of its own.
TEST(TraceCalibration, AMarkerThatIsMuchBentIsShorterToo) {
  const World flat = make_effect_world(filmed());
  constexpr double kOfSize = 0.05;
  const double bend = kOfSize * flat.markers.size_m(TagId{12});
  const Trace trace =
      trace_of(make_effect_world(filmed({{"bent_tag", "tag_12", bend, 0.6}}))).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"bent_tag", "tag_12"}));
  EXPECT_TRUE(size_is_right(trace.accepted.front(), bend)) << trace.accepted.front().size;
  EXPECT_LT(trace.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
}

class Unnamed : public ::testing::TestWithParam<std::string> {};

// Whatever it is taken for, and wherever: an effect of no library has no name.
TEST_P(Unnamed, HasNoNameOfTheLibrary) {
  const std::vector<InjectedEffect> places =
      truth::weakest_effects(GetParam(), truth::robot_of(filmed()));
  ASSERT_FALSE(places.empty());
  InjectedEffect injected = places[places.size() / 2];
  injected.size *= 10.0;
  const Trace trace = trace_of(make_effect_world(filmed({injected}))).trace;
  EXPECT_TRUE(trace.accepted.empty()) << answer(trace);
  EXPECT_TRUE(trace.ambiguities.empty()) << answer(trace);
}

INSTANTIATE_TEST_SUITE_P(TraceCalibration, Unnamed,
                         ::testing::Values("own_tanh", "own_speed", "own_chequer", "own_ripple",
                                           "own_product", "own_acceleration", "own_creep",
                                           "own_vibration", "own_hunting"),
                         [](const auto& tested) { return tested.param; });

// Of 0.7 deg: the time constant that is best beside a model that has bent itself is not the right
// one, and the size says no more than that is known.
TEST(TraceCalibration, ATimeConstantIsFoundWithTheEffectInTheModel) {
  InjectedEffect drift = strong("camera_drift", "camera");
  drift.size = 0.012;
  drift.detail = 1.7;
  const World world = make_effect_world(filmed({drift}));
  const Trace trace = trace_of(world).trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  const TracedEffect& found = trace.accepted.front();
  EXPECT_LE(found.interval.low, drift.size);
  EXPECT_GE(found.interval.high, drift.size);
  EXPECT_NEAR(found.size, drift.size, 0.02 * drift.size);
  const double length_s = world.measurements.times_s.back() - world.measurements.times_s.front();
  EXPECT_NEAR(found.scan, drift.detail * length_s, 0.1 * drift.detail * length_s);
}

// Where the robot is fast, sightings between a wrong instant and the right one stand out and are
// left out: those that are used do not tell one from the other.
TEST(TraceCalibration, AJumpIsWhenTheSightingsSayThatAreLeftOut) {
  const InjectedEffect jump{"clock_jump", "clock", 0.08, 0.45};
  const World world = make_effect_world(filmed({jump}, 400));
  const Trace trace = trace_of(world).trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  const TracedEffect& found = trace.accepted.front();
  EXPECT_EQ(found.id, (EffectId{"clock_jump", "clock"})) << answer(trace);
  const std::vector<double>& times_s = world.measurements.times_s;
  const double jumped_s = jump.detail * (times_s.back() + times_s[1]);
  EXPECT_NEAR(found.scan, jumped_s, 1.5 * times_s[1]);
}

// A straight line is no sum of two that bend, which would be known by their difference only.
TEST(TraceCalibration, ADriftAlongAStraightLineIsOne) {
  InjectedEffect drift = strong("camera_drift", "camera");
  drift.size = 0.012;
  drift.detail = 300.0;
  const Trace trace = trace_of(make_effect_world(filmed({drift}))).trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  const TracedEffect& found = trace.accepted.front();
  EXPECT_EQ(found.id, (EffectId{"camera_drift", "camera"})) << answer(trace);
  EXPECT_LE(found.interval.low, drift.size);
  EXPECT_GE(found.interval.high, drift.size);
  EXPECT_NEAR(found.size, drift.size, 0.02 * drift.size);
  EXPECT_LT(found.interval.high, 1.1 * drift.size);
}

// The log without the effects says where the joint is, but for what a zero is.
void expect_right_readings(const World& world, const std::string& name,
                           const CalibrationTrace& found, double tolerance) {
  const CorrectedLog corrected =
      corrected_log(world.log, world.tree, found.effects, found.gravity_base);
  EXPECT_EQ(corrected.undone.size(), found.effects.size());
  const auto joint = static_cast<Eigen::Index>(value_of(world.tree.joint(name)).index());
  Eigen::VectorXd miss =
      resample(corrected.log, world.measurements.times_s).col(value_of(world.log.channel(name))) -
      world.joint_values.col(joint);
  miss.array() -= miss.mean();
  EXPECT_LT(miss.cwiseAbs().maxCoeff(), tolerance);
}

// A load pulls where the joint has sagged to: of 4 deg, the sine of the reading leaves a second
// harmonic of 0.14 deg, which passed for an eccentricity. Gravity is declared 0.5 deg off.
TEST(TraceCalibration, ALargeSagHasTheLoadOfWhereItLeads) {
  EffectWorldOptions options = filmed({{"compliance", "q2", 0.07}});
  options.kind = truth::RobotKind::kScara;
  options.down = Eigen::Vector3d(0.7, 0.4, -0.5).normalized();
  const World world = make_effect_world(options);
  CalibrationTraceOptions declared;
  declared.gravity_base = Eigen::Vector3d(0.70, 0.41, -0.5).normalized();
  const CalibrationTrace found =
      trace_calibration(world.measurements, world.markers, world.log, start_of(world), declared);
  const Trace& trace = found.trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"compliance", "q2"})) << answer(trace);
  EXPECT_TRUE(size_is_right(trace.accepted.front(), 0.07)) << trace.accepted.front().size;
  EXPECT_LT(trace.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
  expect_right_readings(world, "q2", found, 0.02 * 0.07);
}

// A bent coupling of 3 deg: its overtone, 0.08 deg four times a turn, is no effect of its own.
TEST(TraceCalibration, ABentCouplingHasItsOvertones) {
  constexpr double kSize = 0.053;  // rad
  const World world = make_effect_world(filmed({{"eccentricity", "q2", kSize, 2.0}}));
  const CalibrationTrace found = trace_of(world);
  const Trace& trace = found.trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"eccentricity", "q2"})) << answer(trace);
  EXPECT_EQ(trace.accepted.front().scan, 2.0);
  EXPECT_TRUE(size_is_right(trace.accepted.front(), kSize)) << trace.accepted.front().size;
  EXPECT_LT(trace.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
  expect_right_readings(world, "q2", found, 0.01 * kSize);
}

// A page printed 1 % too large, beside slides that know how far they went.
TEST(TraceCalibration, APrintersScaleIsThatOfAllMarkers) {
  EffectWorldOptions options = filmed();
  options.kind = truth::RobotKind::kGantry;
  options.effects = {{"tag_size", "tags", 0.01}};
  const Trace trace = trace_of(make_effect_world(options)).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"tag_size", "tags"})) << answer(trace);
  EXPECT_TRUE(size_is_right(trace.accepted.front(), 0.01)) << trace.accepted.front().size;
}

// Hinges know no length: whatever its size, the page's scale is the robot's.
TEST(TraceCalibration, APrintersScaleDoesNotShowOnHinges) {
  const std::vector<NotFoundEffect>& missing = clean_trace().trace.not_found;
  const auto scale = std::ranges::find(missing, EffectId{"tag_size", "tags"}, &NotFoundEffect::id);
  ASSERT_NE(scale, missing.end());
  EXPECT_TRUE(scale->hidden);
  EXPECT_NE(scale->record.find("measure"), std::string::npos);
}

// A curve beside a joint's frame stretches the way, too: it contains the scale and is no rival.
TEST(TraceCalibration, ASlidesScaleStandsAlone) {
  EffectWorldOptions options = filmed();
  options.kind = truth::RobotKind::kGantry;
  InjectedEffect scale = truth::weakest_effects("encoder_scale", truth::robot_of(options)).at(0);
  scale.size *= 10.0;
  options.effects = {scale};
  const Trace trace = trace_of(make_effect_world(options)).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"encoder_scale", scale.place})) << answer(trace);
}

TEST(TraceCalibration, ACleanWorldIsClean) {
  const Trace& trace = clean_trace().trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kClean) << answer(trace);
  EXPECT_TRUE(clean_trace().corrections.empty());
  EXPECT_NEAR(trace.noise, std::numbers::sqrt2 * kSigma, kSigmaTolerance);
  EXPECT_NEAR(trace.held_out_after.value, std::numbers::sqrt2 * kSigma, 2.0 * kSigmaTolerance);
}

// A hinge without a log, tracked by poses whose turns scatter ten times as far as they are declared
// to and whose shifts a tenth as far, both the more in depth.
TEST(TraceCalibration, PosesAreWeighedByTheirOwnScatterAndGivenInMetres) {
  constexpr double kSigmaM = 2e-5;
  constexpr double kSigmaRad = 2e-3;
  constexpr double kWrong = 10.0;
  const Eigen::Vector3d depth(1.0, 1.0, 5.0);
  truth::WorldOptions options;
  options.joints = {JointType::kRevolute};
  options.base_tag = false;
  options.frames = 300;
  World world = truth::make_world(options);
  Marker& marker = world.tree.markers.front();
  marker.T_link_marker = marker.T_link_marker * Pose{exp_rotation({0.7, 0.4, 0.0}), {0, 0, 0}};
  Rng rng = Rng::from_name("tracked poses");
  PoseTrack track{marker.id, {}};
  for (Eigen::Index f = 0; f < world.joint_values.rows(); ++f) {
    const auto links = forward_kinematics(world.tree, world.joint_values.row(f).transpose());
    const Pose truth = world.T_camera_base * links[marker.link.index()] * marker.T_link_marker;
    const Eigen::Matrix3d R = truth.rotation.conjugate().toRotationMatrix();  // marker from camera
    Vector6d noise;
    noise << rng.normal3(kSigmaRad), R * depth.cwiseProduct(rng.normal3(kSigmaM));
    PoseSample sample;
    sample.frame = static_cast<int>(f);
    sample.T_camera_marker = truth * exp_pose(noise);
    sample.covariance.setZero();
    sample.covariance.topLeftCorner<3, 3>().diagonal().setConstant(std::pow(kSigmaRad / kWrong, 2));
    sample.covariance.bottomRightCorner<3, 3>() =
        std::pow(kSigmaM * kWrong, 2) * R * depth.cwiseAbs2().asDiagonal() * R.transpose();
    track.samples.push_back(sample);
  }
  Measurements measurements;
  measurements.times_s = world.measurements.times_s;
  measurements.poses = {measurements.times_s, {track}};
  CalibrationStart start = truth::perturbed_start(world, 0.005, 0.001, 1);
  start.tree.joints.front().channel.clear();
  start.joint_values = world.joint_values;
  const Calibration plain = calibrate(measurements, world.markers, {}, start);
  const Trace trace = trace_calibration(measurements, world.markers, {}, start, {}).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kClean) << answer(trace);
  // The joint's value takes a part of the noise.
  EXPECT_LT(plain.training_rms, kSigmaM * depth.norm());
  EXPECT_NEAR(trace.noise, plain.training_rms, 0.05 * plain.training_rms);
  EXPECT_NEAR(trace.held_out_after.value, plain.held_out_rms, 0.05 * plain.held_out_rms);
}

// A camera that says 30 and takes 29.97 frames a second: the clocks part by 33 ms on the way.
TEST(TraceCalibration, AStrongDriftIsFollowedToTheEnds) {
  InjectedEffect drift = strong("clock_drift", "clock");
  drift.size = 1e-3;
  const Trace trace = trace_of(make_effect_world(filmed({drift}))).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_TRUE(size_is_right(trace.accepted.front(), drift.size));
  EXPECT_LT(trace.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
}

// Stamps at arrival, up to 10 ms late: 5 ms on average, and noise that grows with the speed.
TEST(TraceCalibration, StampsThatJitterAreNoSlip) {
  constexpr double kLatest = 0.01;
  World world = make_effect_world(filmed({}, 600));
  Rng rng = Rng::from_name("late stamps");
  for (double& t : world.measurements.times_s) t += rng.uniform(0.0, kLatest);
  const CalibrationTrace found = trace_of(world);
  const Trace& trace = found.trace;
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"time_offset", "clock"})) << answer(trace);
  EXPECT_TRUE(size_is_right(trace.accepted.front(), -0.5 * kLatest));
  EXPECT_NEAR(found.stamp_jitter_s, kLatest / std::sqrt(12.0), 0.1 * kLatest);
}

TEST(TraceCalibration, WhatAGearDoesIsNoJitterOfTheStamps) {
  EXPECT_EQ(clean_trace().stamp_jitter_s, 0.0);
  const CalibrationTrace found =
      trace_of(make_effect_world(filmed({strong("gear_error", "q2")}, 600)));
  EXPECT_EQ(found.stamp_jitter_s, 0.0);
  ASSERT_EQ(found.trace.accepted.size(), 1U) << answer(found.trace);
  EXPECT_EQ(found.trace.accepted.front().id, (EffectId{"gear_error", "q2"}));
}

// The place of a joint's frame along its axis is nobody's to see, and no bearing need sit there.
CalibrationStart with_frame_moved(CalibrationStart start, const std::string& name, double along_m) {
  Joint& joint = start.tree.joints[value_of(start.tree.joint(name)).index()];
  Pose shift;
  shift.translation = along_m * joint.axis;
  joint.T_parent_joint = joint.T_parent_joint * shift;
  for (Joint& next : start.tree.joints) {
    if (next.parent == joint.child) next.T_parent_joint = shift.inverse() * next.T_parent_joint;
  }
  for (Marker& marker : start.tree.markers) {
    if (marker.link == joint.child) marker.T_link_marker = shift.inverse() * marker.T_link_marker;
  }
  return start;
}

TEST(TraceCalibration, AWobblesBearingMayBeAnywhereOnTheAxis) {
  const InjectedEffect wobble = strong("axis_wobble", "q2");
  const World world = make_effect_world(filmed({wobble}));
  const Trace trace = trace_calibration(world.measurements, world.markers, world.log,
                                        with_frame_moved(start_of(world), "q2", 0.3), {})
                          .trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  EXPECT_EQ(trace.accepted.front().id, (EffectId{"axis_wobble", "q2"}));
  EXPECT_LT(trace.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
}

// Another account of the recording, with other joints, may have known more.
TEST(TraceCalibration, WhatThisRobotCannotHaveIsNotBegunWith) {
  const World world = make_effect_world(filmed());
  CalibrationTraceOptions options;
  options.trace.start = {{{"compliance", "q9"}, 0.0}, {{"lens_distortion", "camera"}, 0.0}};
  const Trace trace =
      trace_calibration(world.measurements, world.markers, world.log, start_of(world), options)
          .trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kClean) << answer(trace);
}

TEST(TraceCalibration, AJointThatSagsTellsWhereGravityPoints) {
  const InjectedEffect sag = strong("compliance", "q2");
  const CalibrationTrace found = trace_of(make_effect_world(filmed({sag})));
  EXPECT_EQ(found.trace.verdict, TraceVerdict::kEffects) << answer(found.trace);
  ASSERT_EQ(found.trace.accepted.size(), 1U) << answer(found.trace);
  EXPECT_EQ(found.trace.accepted.front().id, (EffectId{"compliance", "q2"}));
  EXPECT_TRUE(size_is_right(found.trace.accepted.front(), sag.size));
  EXPECT_LT(found.trace.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
  constexpr double kAlike = 0.15;  // rad; the masses' places are guessed
  ASSERT_TRUE(found.gravity_base);
  EXPECT_LT(std::acos(-found.gravity_base->z()), kAlike) << found.gravity_base->transpose();
  EXPECT_FALSE(clean_trace().gravity_base);
}

// q3's log shows its motor, which q2 turns, too; the model takes `ratio` for it.
CalibrationTrace trace_of_coupled(double truth, double ratio) {
  World world = make_effect_world(filmed());
  const int motor = value_of(world.log.channel("q3"));
  world.log.values.col(motor) -= truth * world.log.values.col(value_of(world.log.channel("q2")));
  CalibrationStart start = start_of(world);
  start.tree.joints[value_of(start.tree.joint("q3")).index()].couplings = {{"q2", ratio}};
  return trace_calibration(world.measurements, world.markers, world.log, start, {});
}

void expect_coupling(const CalibrationTrace& found, double truth) {
  const Trace& trace = found.trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kEffects) << answer(trace);
  EXPECT_EQ(trace.reason, "the model lacked coupling at q3");
  ASSERT_EQ(trace.accepted.size(), 1U) << answer(trace);
  const TracedEffect& coupling = trace.accepted.front();
  EXPECT_EQ(coupling.id, (EffectId{"coupling", "q3"}));
  EXPECT_EQ(coupling.scan_words, "q2");
  EXPECT_LT(coupling.interval.low, truth);
  EXPECT_GT(coupling.interval.high, truth);
  EXPECT_NEAR(coupling.size, truth, 1e-3);
  EXPECT_GT(coupling.explained, 0.99);
  EXPECT_LT(coupling.p_value, 1e-9);
  EXPECT_LT(trace.held_out_after.value,
            kWithoutAfterOverClean * clean_trace().trace.held_out_after.value);
  EXPECT_GT(trace.held_out_before.value, 20.0 * trace.held_out_after.value);
  EXPECT_GT(coupling.held_out_before.value, 20.0 * coupling.held_out_after.value);
}

TEST(TraceCalibration, ACouplingByDesignIsAnEffectWithItsErrorBefore) {
  const CalibrationTrace found = trace_of_coupled(-1.0, -1.0);
  expect_coupling(found, -1.0);
  EXPECT_TRUE(found.trace.design_comes_first);
  EXPECT_TRUE(found.corrections.empty());
}

// A short recording may suggest a ratio to the structure that is nothing.
TEST(TraceCalibration, ACouplingByDesignThatIsNothingIsNotNamed) {
  const World world = make_effect_world(filmed());
  CalibrationStart start = start_of(world);
  start.tree.joints[value_of(start.tree.joint("q3")).index()].couplings = {{"q2", 1e-6}};
  const Trace trace =
      trace_calibration(world.measurements, world.markers, world.log, start, {}).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kClean) << answer(trace);
  EXPECT_TRUE(trace.accepted.empty()) << answer(trace);
  EXPECT_FALSE(trace.design_comes_first);
}

// What is sized again beside the ratio that the model has.
TEST(TraceCalibration, ACouplingBeyondItsDesignIsGivenWithTheRatio) {
  const World world = make_effect_world(filmed());
  CalibrationStart start = start_of(world);
  start.tree.joints[value_of(start.tree.joint("q3")).index()].couplings = {{"q2", -1.0}};
  const EffectBundle bundle(world.measurements, world.markers, world.log, start, {});
  ASSERT_EQ(bundle.couplings().size(), 1U);
  const AddedEffect own{{"coupling", "q3"}, static_cast<double>(bundle.couplings().front().other)};
  TracedEffect beyond;
  beyond.id = own.id;
  beyond.scan = own.scan;
  beyond.size = 0.02;
  beyond.interval = {0.019, 0.021};
  beyond.values.resize(1);
  beyond.values.front().value = 0.02;
  Trace trace;
  trace.accepted = {beyond};
  effects::shift_ratios_by_design(bundle, 1.0, trace);
  EXPECT_EQ(trace.accepted.front().size, 0.02) << "nothing was found beyond the ratio";
  trace.added = {own};
  effects::shift_ratios_by_design(bundle, 1.0, trace);
  const TracedEffect& whole = trace.accepted.front();
  EXPECT_DOUBLE_EQ(whole.size, -0.98);
  EXPECT_DOUBLE_EQ(whole.interval.low, -0.981);
  EXPECT_DOUBLE_EQ(whole.interval.high, -0.979);
  EXPECT_DOUBLE_EQ(whole.values.front().value, -0.98);
}

TEST(TraceCalibration, WhatACouplingIsBeyondItsDesignIsPartOfIt) {
  const CalibrationTrace found = trace_of_coupled(0.31, 0.3);
  expect_coupling(found, 0.31);
  EXPECT_EQ(found.corrections.size(), 1U);
}

TEST(TraceCalibration, ARecordingTooShortSaysSo) {
  const Trace trace = trace_of(make_effect_world(filmed({}, 8))).trace;
  EXPECT_EQ(trace.verdict, TraceVerdict::kNothingToSay) << answer(trace);
  EXPECT_FALSE(trace.reason.empty());
  EXPECT_TRUE(trace.accepted.empty());
}

void expect_same(const CalibrationTrace& a, const CalibrationTrace& b) {
  EXPECT_EQ(a.trace.verdict, b.trace.verdict);
  EXPECT_EQ(a.trace.noise, b.trace.noise);
  EXPECT_EQ(a.trace.held_out_before.value, b.trace.held_out_before.value);
  EXPECT_EQ(a.trace.held_out_after.value, b.trace.held_out_after.value);
  EXPECT_EQ(a.trace.held_out_after.interval.low, b.trace.held_out_after.interval.low);
  ASSERT_EQ(a.trace.candidates.size(), b.trace.candidates.size());
  for (std::size_t i = 0; i < a.trace.candidates.size(); ++i) {
    EXPECT_EQ(a.trace.candidates[i].id, b.trace.candidates[i].id);
    EXPECT_EQ(a.trace.candidates[i].state, b.trace.candidates[i].state);
    EXPECT_EQ(a.trace.candidates[i].statistic, b.trace.candidates[i].statistic);
    EXPECT_EQ(a.trace.candidates[i].held_out, b.trace.candidates[i].held_out);
  }
  ASSERT_EQ(a.effects.size(), b.effects.size());
  for (std::size_t i = 0; i < a.effects.size(); ++i) {
    EXPECT_EQ(a.effects[i].id, b.effects[i].id);
    EXPECT_EQ(a.effects[i].scan, b.effects[i].scan);
    EXPECT_EQ(a.effects[i].values, b.effects[i].values);
    EXPECT_EQ(a.trace.accepted[i].interval.low, b.trace.accepted[i].interval.low);
  }
}

TEST(TraceCalibration, TheSameInputInAnyOrderGivesTheSameBits) {
  World world = make_effect_world(filmed({strong("tag_slip", "tag_12")}, 100));
  const CalibrationTrace first = trace_of(world);
  ASSERT_FALSE(first.effects.empty());
  expect_same(first, trace_of(world));
  Rng rng = Rng::from_name("shuffle");
  std::vector<TagObservation>& corners = world.measurements.corners;
  for (std::size_t i = corners.size(); i > 1; --i) {
    std::swap(corners[i - 1], corners[static_cast<std::size_t>(rng.index(static_cast<int>(i)))]);
  }
  expect_same(first, trace_of(world));
}

}  // namespace
}  // namespace kinescope
