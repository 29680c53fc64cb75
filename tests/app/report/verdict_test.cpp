// SPDX-License-Identifier: Apache-2.0
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "app/report/findings.h"
#include "app/report/report.h"
#include "tests/app/report/synthetic_run.h"

namespace kinescope {
namespace {

TEST(Verdict, OfAVideoWithALog) {
  const Verdict verdict = make_verdict(synthetic_run());
  EXPECT_TRUE(has(verdict.found, "3 joints in a chain (R R P)")) << verdict.found;
  EXPECT_TRUE(has(verdict.found, "each driven by its own logged channel")) << verdict.found;
  EXPECT_TRUE(has(verdict.found, "0.999930")) << verdict.found;
  EXPECT_TRUE(has(verdict.accurate, "at postures that the fit has not seen")) << verdict.accurate;
  EXPECT_TRUE(has(verdict.accurate, " px, or ")) << verdict.accurate;
  EXPECT_TRUE(has(verdict.accurate, "least certain is q3 with 0.028° in direction."))
      << verdict.accurate;
  EXPECT_TRUE(has(verdict.accurate, "frame time + (12.30 ± 0.42) ms")) << verdict.accurate;
  EXPECT_TRUE(has(verdict.limits, "noise of the measurement limits")) << verdict.limits;
  EXPECT_TRUE(has(verdict.limits, "within 4 %")) << verdict.limits;
}

TEST(Verdict, BeginsItsAccuracyWithTheLastLink) {
  RunSummary run = synthetic_run();
  const std::string accurate = make_verdict(run).accurate;
  EXPECT_TRUE(accurate.starts_with("The URDF says where the last link is (tag_7 on ")) << accurate;
  EXPECT_TRUE(has(accurate, "in the frame of tag_0 (expanded uncertainty, k = 2")) << accurate;
  run.shown_by_log = {{"backlash", "q2"}};
  EXPECT_TRUE(has(make_verdict(run).accurate, "The URDF, with corrected joint values, says"));
  run.calibration.status = CalibrationStatus::kNotConverged;
  EXPECT_FALSE(has(make_verdict(run).accurate, "last link"));
}

TEST(Verdict, NamesTheCommandThatChoosesOtherPostures) {
  constexpr const char* kPlan = "`kinescope plan` with the folder of this run chooses them.";
  RunSummary run = synthetic_run();
  EXPECT_TRUE(make_verdict(run).next.ends_with(kPlan)) << make_verdict(run).next;
  EXPECT_FALSE(has(make_verdict(synthetic_run({.log = false})).next, "plan"));
  run.calibration.status = CalibrationStatus::kUndetermined;
  run.calibration.status_reason = "the axis of q2 is not determined";
  EXPECT_FALSE(has(make_verdict(run).next, "plan"));
}

TEST(Verdict, NamesThePostureThatStandsAlone) {
  RunSummary run = synthetic_run({.kind = MeasurementKind::kPoint});
  EXPECT_FALSE(has(make_verdict(run).limits, "bent to it"));
  SightingResidual& one = run.calibration.residuals[20];
  one.used = true;
  one.held_out_displacement << 0.0, 0.0, 0.0, 0.4, 0.0, 0.3;
  run.calibration.held_out_rms = 20.0 * run.calibration.training_rms;
  const std::string limits = make_verdict(run).limits;
  const double time_s = run.calibration.times_s[static_cast<std::size_t>(one.frame)];
  EXPECT_TRUE(has(limits, fmt::format("At t = {:.6g} the error is ", time_s))) << limits;
  EXPECT_TRUE(has(limits, "the fit has bent to it")) << limits;
  EXPECT_FALSE(has(limits, "not the measuring noise")) << limits;
}

TEST(Verdict, SaysWhatTheDeclaredSizesAndIntrinsicsAdd) {
  RunSummary run = synthetic_run();
  for (Marker& marker : run.calibration.tree.markers) marker.size_m = 0.048;
  std::string accurate = make_verdict(run).accurate;
  EXPECT_TRUE(has(accurate, " mm across the line of sight (rms)")) << accurate;
  EXPECT_TRUE(has(accurate, "exactly 48.0 mm: each 0.1 mm changes all lengths by 0.21 %"))
      << accurate;
  EXPECT_TRUE(has(accurate, "declared intrinsics")) << accurate;
  run.calibration.intrinsics_estimated = true;
  run.calibration.tree.markers[1].size_m = 0.06;
  accurate = make_verdict(run).accurate;
  EXPECT_TRUE(has(accurate, "exactly the declared sizes")) << accurate;
  EXPECT_FALSE(has(accurate, "declared intrinsics")) << accurate;
  accurate = make_verdict(synthetic_run({.kind = MeasurementKind::kPoint})).accurate;
  EXPECT_FALSE(has(accurate, "markers of exactly")) << accurate;
  EXPECT_FALSE(has(accurate, "line of sight")) << accurate;
}

TEST(Verdict, NamesAChannelThatDrivesTwoJoints) {
  RunSummary run = synthetic_run();
  KinematicTree& tree = run.calibration.tree;
  tree.joints[1].channel = tree.joints[0].channel;
  const Verdict verdict = make_verdict(run);
  EXPECT_TRUE(has(verdict.found, "driven by logged channels, q1 drives 2 of them"))
      << verdict.found;
}

TEST(Verdict, NamesACouplingByDesign) {
  RunSummary run = synthetic_run();
  EXPECT_FALSE(has(make_verdict(run).found, "coupled"));
  run.calibration.tree.joints[1].couplings = {{"q1", -1.0}};
  EXPECT_TRUE(has(make_verdict(run).found, "is coupled: q1 moves it too, -1 times"))
      << make_verdict(run).found;
}

TEST(Verdict, ADoubtThatTracingSettlesIsNoLimit) {
  RunSummary run = synthetic_run();
  run.structure->doubts.push_back({"the markers move as the joints say only roughly", "check", {}});
  run.structure->doubts.back().of_model = true;
  EXPECT_TRUE(has(make_verdict(run).limits, "only roughly"));
  run.trace = Trace{};
  EXPECT_TRUE(has(make_verdict(run).limits, "only roughly"));
  run.trace->accepted.emplace_back();
  EXPECT_FALSE(has(make_verdict(run).limits, "only roughly"));
}

TEST(Verdict, NamesAnIdThatTwoMarkersCarry) {
  RunSummary run = synthetic_run();
  run.warnings = {"marker 9 is declared and never seen",
                  "two markers with id 7 are in view: remove one (the one that moves is taken)"};
  const Verdict verdict = make_verdict(run);
  EXPECT_TRUE(verdict.limits.ends_with(
      ". Two markers with id 7 are in view: remove one (the one that moves is taken)."))
      << verdict.limits;
  EXPECT_FALSE(has(verdict.limits, "marker 9"));
}

TEST(Verdict, ALateLogHasAMinus) {
  RunSummary run = synthetic_run();
  run.calibration.time_offset_s = -0.0123;
  EXPECT_TRUE(has(make_verdict(run).accurate, "frame time - (12.30 ± 0.42) ms"));
}

TEST(Verdict, NamesTheJointThatTheResidualFollows) {
  constexpr double kGearError = 0.002;  // rad; 0.115 degrees, well above the corner noise
  const Verdict verdict = make_verdict(synthetic_run({.gear_error_rad = kGearError}));
  EXPECT_TRUE(has(verdict.limits, "along the motion of q2")) << verdict.limits;
  EXPECT_TRUE(has(verdict.limits, "±0.11") || has(verdict.limits, "±0.10")) << verdict.limits;
  EXPECT_TRUE(has(verdict.next, "sweeps of q2")) << verdict.next;
  EXPECT_FALSE(has(verdict.limits, "noise of the measurement limits")) << verdict.limits;
  EXPECT_TRUE(has(verdict.limits, "the model lacks")) << verdict.limits;
}

TEST(Verdict, DoesNotContradictTracing) {
  RunSummary run = synthetic_run({.gear_error_rad = 0.002});
  run.trace.emplace();
  run.trace->verdict = TraceVerdict::kClean;
  const Verdict clean = make_verdict(run);
  EXPECT_TRUE(has(clean.limits, "along the motion of q2")) << clean.limits;
  EXPECT_FALSE(has(clean.limits, "the model lacks")) << clean.limits;
  run.trace->verdict = TraceVerdict::kNothingToSay;
  EXPECT_TRUE(has(make_verdict(run).limits, "the model lacks"));
}

TEST(Verdict, SaysWhenUnseenDataAreWorse) {
  RunSummary run = synthetic_run();
  run.calibration.held_out_rms = 1.4 * run.calibration.training_rms;
  EXPECT_TRUE(has(make_verdict(run).limits, "1.40 times"));
  EXPECT_TRUE(has(make_verdict(run).limits, "model and postures"));
  run.trace.emplace();
  run.trace->accepted.emplace_back();
  run.trace->accepted.back().id = {"quantisation", "q2"};
  EXPECT_TRUE(has(make_verdict(run).limits, "1.40 times"));
  EXPECT_TRUE(has(make_verdict(run).limits, "the log does not say where q2 is"));
  EXPECT_FALSE(has(make_verdict(run).limits, "model and postures"));
  run.calibration.folds = 0;
  EXPECT_TRUE(has(make_verdict(run).limits, "nothing was held out"));
}

TEST(Verdict, OfPointsWithANominalRobot) {
  RunSummary run = synthetic_run({.kind = MeasurementKind::kPoint, .nominal = true});
  run.levels = {{.free = FreeGeometry::kPlacement, .errors = run.errors.all}};
  const Verdict verdict = make_verdict(run);
  EXPECT_TRUE(has(verdict.found, "Nominal robot bench_arm: 3 joints (R R P), 4 points calibrated"))
      << verdict.found;
  EXPECT_TRUE(has(verdict.accurate, "The nominal robot at unseen postures: only placed: "))
      << verdict.accurate;
  EXPECT_FALSE(has(verdict.accurate, "px")) << verdict.accurate;
  EXPECT_FALSE(has(verdict.found, "probability")) << verdict.found;
}

TEST(Verdict, NamesWhatWasWrongWithTheNominalRobot) {
  RunSummary run = synthetic_run({.kind = MeasurementKind::kPoint, .nominal = true});
  run.levels = {{.free = FreeGeometry::kPlacement, .errors = run.errors.all}};
  KinematicTree& nominal = *run.nominal;
  nominal.joints[0].axis = Eigen::Vector3d::UnitX();
  run.nominal_faults = {{.joint = 0,
                         .axis = -Eigen::Vector3d::UnitZ(),
                         .marker = TagId{4},
                         .before = {.m = 0.02},
                         .after = {.m = 0.001}},
                        {.joint = 1, .exchanged_with = 2, .marker = TagId{5}}};
  const Verdict verdict = make_verdict(run);
  EXPECT_TRUE(has(verdict.found,
                  "q1 of the nominal robot moves about -z of its joint frame, not x; taken so "
                  "(typical error of tag_4 in a first fit 20.0 mm → 1.00 mm)."))
      << verdict.found;
  EXPECT_TRUE(has(verdict.accurate, "The nominal robot, mended, at unseen postures"))
      << verdict.accurate;
  EXPECT_TRUE(has(verdict.found, "The channels of q2 and q3 are exchanged; taken so"))
      << verdict.found;
}

TEST(Verdict, NamesTheColumnsOfANominalRobotWhoseJointsAreCalledOtherwise) {
  RunSummary run = synthetic_run({.kind = MeasurementKind::kPoint, .nominal = true});
  EXPECT_FALSE(has(make_verdict(run).found, "No column")) << make_verdict(run).found;
  run.calibration.tree.joints[0].name = "shoulder";
  const std::string found = make_verdict(run).found;
  EXPECT_TRUE(has(found, "No column is named like these joints: q1 drives shoulder.")) << found;
}

TEST(Verdict, AnOddScaleIsSaidWithTheTagSizeAsACause) {
  RunSummary run = synthetic_run();
  EXPECT_FALSE(has(make_verdict(run).found, "unit of its own")) << make_verdict(run).found;
  run.calibration.tree.joints[0].scale = 0.00153;
  run.calibration.tree.joints[2].scale = 1.2;
  const std::string found = make_verdict(run).found;
  EXPECT_TRUE(has(found, "q1 counts in a unit of its own, 0.00153 rad each.")) << found;
  EXPECT_TRUE(has(found,
                  "q3 counts in a unit of its own, 1.2 m each; if it is logged in m, the "
                  "tags are declared 1.2 times as large as they are."))
      << found;
}

TEST(Verdict, ScalesThatWereEstimatedNearAUnitAreNamed) {
  RunSummary run = synthetic_run();
  EXPECT_FALSE(has(make_verdict(run).found, "estimated, too")) << make_verdict(run).found;
  run.calibration.tree.joints[1].scale = 0.956;
  run.calibration.joints[1].scale_sigma = 0.01;
  const std::string found = make_verdict(run).found;
  EXPECT_TRUE(has(found, "What a unit of q2 (0.956 rad) is was estimated, too.")) << found;
}

TEST(Verdict, WithoutALogTheValuesAreEstimates) {
  const Verdict verdict = make_verdict(synthetic_run({.log = false}));
  EXPECT_TRUE(has(verdict.found, "the joint values are estimates from the markers"))
      << verdict.found;
  EXPECT_TRUE(has(verdict.accurate, "in stretches of the recording")) << verdict.accurate;
  EXPECT_FALSE(has(verdict.accurate, "frame time")) << verdict.accurate;
}

TEST(Verdict, ChannelsThatMoveAndDriveNothingAreNamed) {
  RunSummary run = synthetic_run();
  // The battery's voltage never changes.
  EXPECT_FALSE(has(make_verdict(run).found, "battery")) << make_verdict(run).found;
  run.log.values(1, 3) += 0.1;
  const Verdict verdict = make_verdict(run);
  EXPECT_TRUE(has(verdict.found, "The channel battery moves and drives nothing.")) << verdict.found;
}

TEST(Verdict, AnUndeterminedStructureStandsFirst) {
  RunSummary run = synthetic_run();
  run.structure->status = StructureStatus::kUndetermined;
  run.structure->doubts = {{"q2 and q3 move together", "Move q3 while q2 rests", {"q2", "q3"}}};
  const Verdict verdict = make_verdict(run);
  EXPECT_TRUE(has(verdict.found, "cannot determine the structure")) << verdict.found;
  EXPECT_EQ(verdict.limits.find("This is no answer: q2 and q3 move together."), 0U)
      << verdict.limits;
  EXPECT_EQ(verdict.next.find("Move q3 while q2 rests."), 0U) << verdict.next;
}

TEST(Verdict, AdviceSaysSomething) {
  RunSummary run = synthetic_run();
  const auto turn = [&](std::size_t joint, double range) {
    run.calibration.joints[joint].range = {.lower = 0.0, .upper = range};
    run.calibration.joints[joint].direction_sigma_rad = joint == 1 ? 2e-3 : 1e-3;
  };
  turn(0, 20.0);
  turn(1, 6.0);
  turn(2, 0.1);
  Verdict verdict = make_verdict(run);
  EXPECT_TRUE(has(verdict.limits, "The axis of q2 is the least certain")) << verdict.limits;
  EXPECT_FALSE(has(verdict.next, "further")) << verdict.next;
  EXPECT_TRUE(has(verdict.next, "independent frames (")) << verdict.next;
  turn(1, 2.0);
  verdict = make_verdict(run);
  EXPECT_TRUE(has(verdict.next, "Move q2 further than the 115°")) << verdict.next;
  // Of one joint the line on accuracy has said it.
  run.calibration.tree.joints[0].type = JointType::kFixed;
  run.calibration.tree.joints[2].type = JointType::kFixed;
  verdict = make_verdict(run);
  EXPECT_FALSE(has(verdict.limits, "The axis of q2")) << verdict.limits;
}

TEST(Verdict, AFailedSolveIsSaidFirst) {
  RunSummary run = synthetic_run();
  run.calibration.status = CalibrationStatus::kNotConverged;
  run.calibration.status_reason = "100 iterations were not enough";
  EXPECT_EQ(make_verdict(run).limits.find(
                "This is no answer: the fit did not settle: 100 iterations were not enough."),
            0U);
}

TEST(Verdict, PointsAtAMarkerThatIsRarelySeenOrOftenRejected) {
  RunSummary run = synthetic_run();
  run.markers[3].frames_seen = 20;
  EXPECT_TRUE(has(make_verdict(run).limits, "tag_7 was seen in 20 of 300 frames only."));
  run = synthetic_run();
  run.calibration.markers[2].rejected = 60;
  EXPECT_TRUE(has(make_verdict(run).limits, "sightings of tag_2 were left out"));
}

TEST(Verdict, NamesKeepTheirSpelling) {
  EXPECT_EQ(report::sentence("tag 12 moves"), "Tag 12 moves.");
  EXPECT_EQ(report::sentence("q2 drives 2 joints"), "q2 drives 2 joints.");
  EXPECT_EQ(report::sentence("lens_distortion at camera: 0.05"),
            "lens_distortion at camera: 0.05.");
}

}  // namespace
}  // namespace kinescope
