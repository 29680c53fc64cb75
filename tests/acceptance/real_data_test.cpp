// SPDX-License-Identifier: Apache-2.0
//
// The program on measured recordings of others, read where they lie: joint types and order, what
// must not be called a joint, and held-out errors. tests/experiments/real_data prints all figures
// beside the first fits.
#include <gtest/gtest.h>

#include "calib/vision/board.h"
#include "tests/experiments/real_run.h"
#include "tests/experiments/real_sets.h"
#include "tests/truth/shared_data.h"

namespace kinescope::real {
namespace {

namespace fs = std::filesystem;

class RealData : public testing::Test {
 protected:
  RealData() : scratch_(testing::UnitTest::GetInstance()->current_test_info()->name()) {}

  /// The folder of a set, or a skip with its reason.
  bool find(const char* set) {
    const auto found = shared_data(std::string("vision/") + set);
    if (found) data_ = *found;
    return found.has_value();
  }
  [[nodiscard]] fs::path recording() const { return scratch_.path() / "recording"; }
  [[nodiscard]] fs::path output() const { return scratch_.path() / "run"; }

  [[nodiscard]] Outcome calibrated(const RecordingPaths& paths, FreeGeometry free,
                                   bool trace = true) const {
    CalibrateOptions options;
    options.free = free;
    return run_recording(paths, output(), options, trace);
  }

  ScratchFolder scratch_;
  fs::path data_;
};

#define NEEDS(set) \
  if (!find(set)) GTEST_SKIP() << "shared data vision/" << (set) << " is not on this machine"

TEST_F(RealData, APositionerIsTwoRevoluteJointsInOrder) {
  NEEDS("positioner_2r");
  const Outcome o = run_recording(positioner(data_, recording()), output());
  EXPECT_EQ(o.code, ExitCode::kDone) << o.message;
  EXPECT_EQ(o.types(), "revolute revolute");
  EXPECT_EQ(o.order(), "joint_1 joint_2");
  EXPECT_LT(o.errors.held_out.mm, 0.5);
  EXPECT_LT(o.errors.held_out.deg, 0.06);
}

// One marker at the flange, every joint swept alone from one posture: such a recording holds no
// order, which is then taken from the log and said to be.
TEST_F(RealData, AnArmSweptJointByJointIsSixRevoluteJoints) {
  NEEDS("industrial_arm_laser_sweeps");
  const Outcome o = run_recording(laser_sweeps(data_, recording()), output());
  EXPECT_EQ(o.types(), "revolute revolute revolute revolute revolute revolute");
  EXPECT_EQ(o.order(), "j1 j2 j3 j4 j5 j6");
  EXPECT_EQ(o.code, ExitCode::kUndetermined);
  EXPECT_NE(o.message.find("order"), std::string::npos) << o.message;
  EXPECT_LT(o.errors.fit.mm, 0.25);
}

TEST_F(RealData, ADoorIsAHinge) {
  NEEDS("door_hinge_aruco");
  for (const bool video : {true, false}) {
    const Outcome o = run_recording(
        video ? door_video(data_, recording() / "video") : door_poses(data_, recording() / "poses"),
        output() / (video ? "video" : "poses"));
    EXPECT_EQ(o.code, ExitCode::kDone) << o.message;
    EXPECT_EQ(o.types(), "revolute");
    EXPECT_LT(o.errors.held_out.mm, 0.87) << "the first fit";
    // Opened and closed once: what depends on the door's angle would look like a camera that moved.
    ASSERT_TRUE(o.trace.contains("verdict"));
    EXPECT_NE(o.trace["verdict"], "effects") << o.trace["reason"];
  }
}

TEST_F(RealData, AnArmOnALineIsASlider) {
  NEEDS("kuka_linear_chessboard");
  BoardSpec board;
  board.columns = 28;
  board.rows = 17;
  board.square_m = 0.02;
  const IntrinsicCalibration lens = calibrate_intrinsics(data_ / "images", board);
  const Outcome o = run_recording(kuka_chessboard(data_, recording(), lens.camera), output());
  ASSERT_FALSE(o.joints.empty()) << o.message;
  for (const FoundJoint& joint : o.joints) EXPECT_EQ(joint.type, "prismatic") << joint.channel;
}

TEST_F(RealData, BodiesMovedByHandAreNoRobots) {
  NEEDS("tagslam_block_tumble");
  const std::pair<const char*, const char*> sets[] = {{"tagslam_block_tumble", "/detector/tags"},
                                                      {"tagslam_stereo_cube", "/detector_0/tags"}};
  for (const auto& [set, topic] : sets) {
    SCOPED_TRACE(set);
    NEEDS(set);
    const Outcome o = run_recording(tagslam(data_, recording() / set, topic), output() / set);
    EXPECT_FALSE(o.status.empty()) << o.message;
    for (const FoundJoint& joint : o.joints) EXPECT_EQ(joint.type, "fixed");
  }
}

// The board was held and turned about one axis by almost half a turn either way; a hinge explains
// that to 0.15 mm, so that the recording alone cannot say that nothing held the axis. That its
// tags are one body must come out.
TEST_F(RealData, ABoardTurnedInPlaceIsOneBody) {
  NEEDS("tagslam_board_d435");
  const Outcome o = run_recording(tagslam(data_, recording(), "/camera/color/tags"), output());
  EXPECT_LE(o.joints.size(), 1U);
  EXPECT_TRUE(std::ranges::any_of(o.links, [](const auto& tags) { return tags.size() == 8; }));
}

TEST_F(RealData, ABallInSocketsCalibratesAPanda) {
  NEEDS("mukca_ball_socket");
  const RecordingPaths paths = ball_socket(data_, recording(), "panda_2.csv");
  EXPECT_LT(calibrated(paths, FreeGeometry::kOffsets).errors.fit.mm, 0.95) << "the first fit";
  // What tracing adds takes minutes here (tests/experiments/real_data).
  EXPECT_LT(calibrated(paths, FreeGeometry::kGeometry, false).errors.held_out.mm, 0.4);
}

TEST_F(RealData, ACameraOnTheFlangeCalibratesAnFr3) {
  NEEDS("franka_fr3_eye_in_hand");
  const Outcome o = calibrated(franka_fr3(data_, recording()), FreeGeometry::kGeometry);
  EXPECT_LT(o.errors.held_out.mm, 1.49) << "the first fit";
  EXPECT_LT(o.errors.held_out.deg, 0.22);
}

TEST_F(RealData, ATrackerCalibratesAnArmOnATurntable) {
  NEEDS("motoman_dual_arm_aruco");
  const Outcome o = calibrated(motoman_tracker(data_, recording()), FreeGeometry::kGeometry);
  EXPECT_LT(o.errors.fit.mm, 0.071) << "the first fit";
  EXPECT_LT(o.errors.held_out.mm, 0.08);
}

TEST_F(RealData, PosesOfATargetCalibrateAUr10) {
  NEEDS("ur10_realsense_chessboard");
  const Outcome o = calibrated(ur10_chessboard(data_, recording()), FreeGeometry::kGeometry);
  EXPECT_LT(o.errors.held_out.mm, 5.0);
  EXPECT_LT(o.errors.held_out.mm, 0.5 * o.errors.before.mm) << "geometry, not offsets, is wrong";
}

// The error that is left of geometry repeats with the large joints' values, in no known shape.
TEST_F(RealData, WhatRepeatsWithTheJointsOfAUr10IsPartOfItsModel) {
  NEEDS("ur10_tracker_sessions");
  RecordingPaths paths;
  paths.folder = data_ / "B";
  const Outcome o = calibrated(paths, FreeGeometry::kGeometry);
  ASSERT_TRUE(o.trace.contains("accepted"));
  EXPECT_TRUE(std::ranges::any_of(
      o.trace["accepted"], [](const auto& effect) { return effect["effect"] == "joint_map"; }));
  EXPECT_LT(o.errors.held_out.mm, 0.146) << "an independent fit with 40 harmonics a joint";
}

}  // namespace
}  // namespace kinescope::real
