// SPDX-License-Identifier: Apache-2.0
#include "app/report/answer.h"

#include <gtest/gtest.h>

#include "tests/app/report/synthetic_run.h"

namespace kinescope {
namespace {

// As where the frames of the joints are estimated.
void add_turns(Calibration& calibration) {
  for (const Joint& joint : calibration.tree.joints) {
    Parameter turn;
    turn.name = joint.name + " turn x";
    turn.block = joint.name;
    turn.unit = "rad";
    calibration.parameters.push_back(turn);
  }
}

TEST(Answer, ARunThatHasOneHasNothingToSay) {
  for (const MeasurementKind kind :
       {MeasurementKind::kCorners, MeasurementKind::kPose, MeasurementKind::kPoint}) {
    const Answer answer = judge(synthetic_run({.kind = kind}));
    EXPECT_TRUE(answer.given) << answer.what;
  }
}

TEST(Answer, AFitThatDidNotSettleIsNone) {
  RunSummary run = synthetic_run();
  run.calibration.status = CalibrationStatus::kNotConverged;
  run.calibration.status_reason = "100 iterations were not enough";
  const Answer answer = judge(run);
  EXPECT_FALSE(answer.given);
  EXPECT_TRUE(has(answer.what, "did not settle: 100 iterations")) << answer.what;
  EXPECT_FALSE(answer.remedy.empty());
}

TEST(Answer, ARobotThatMissesItsMarkersIsAnother) {
  RunSummary run = synthetic_run();
  for (SightingResidual& sighting : run.calibration.residuals) {
    for (Eigen::Vector2d& corner : sighting.corners_px) corner *= 1e4;
  }
  // Of a geometry that the user holds, that is what was asked.
  run.free_asked = true;
  RunSummary held = run;
  std::erase_if(held.calibration.parameters,
                [](const Parameter& one) { return one.block.starts_with("q"); });
  EXPECT_TRUE(judge(held).given);
  add_turns(run.calibration);
  const Answer answer = judge(run);
  EXPECT_FALSE(answer.given);
  EXPECT_TRUE(has(answer.what, "misses its markers by")) << answer.what;
}

TEST(Answer, AxesOfWhichNothingIsKnownAreNone) {
  RunSummary run = synthetic_run();
  add_turns(run.calibration);
  for (JointEstimate& joint : run.calibration.joints) joint.direction_sigma_rad.reset();
  const Answer answer = judge(run);
  EXPECT_FALSE(answer.given);
  EXPECT_TRUE(has(answer.what, "nothing is known of the axes of")) << answer.what;
}

TEST(Answer, AnotherStructureAsProbableIsNone) {
  RunSummary run = synthetic_run();
  run.structure->status = StructureStatus::kAmbiguous;
  run.structure->doubts.clear();
  run.structure->runner_up = "channels 'q2' and 'q3' exchanged";
  const Answer answer = judge(run);
  EXPECT_FALSE(answer.given);
  EXPECT_TRUE(has(answer.what, "channels 'q2' and 'q3' exchanged")) << answer.what;
}

}  // namespace
}  // namespace kinescope
