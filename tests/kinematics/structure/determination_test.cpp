// SPDX-License-Identifier: Apache-2.0
//
// What a recording cannot determine is said, with the names concerned and what to record instead.
#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

bool names(const Structure& s, const std::string& name) {
  return std::ranges::any_of(s.doubts, [&](const StructureDoubt& d) {
    return !d.remedy.empty() && std::ranges::find(d.names, name) != d.names.end();
  });
}

std::string channel_name(const Scene& scene, std::size_t joint) {
  return scene.recording.log
      .channels[static_cast<std::size_t>(scene.recording.channel_of_joint[joint])];
}

TEST(Determination, AJointThatHardlyMovesIsNamedOnly) {
  RecordingOptions o = noisy();
  o.still_joints = {1};
  Scene scene = make_scene("Still", {.joints = 3}, o);
  // It trembles by a hundredth of a degree.
  Rng rng = Rng::from_name("Still", 2);
  auto column = scene.recording.log.values.col(scene.recording.channel_of_joint[1]);
  for (Eigen::Index i = 0; i < column.size(); ++i) column(i) += rng.normal(2e-4);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(s.status, StructureStatus::kDetermined);
  EXPECT_TRUE(names(s, channel_name(scene, 1)));
  EXPECT_EQ(s.joints.size(), 2U);
}

// A column that never changes may be a closed gripper or a flag as well as a joint at rest: what
// the recording shows stands, with a warning.
TEST(Determination, AColumnThatNeverChangesIsNamedOnly) {
  RecordingOptions o = noisy();
  o.still_joints = {1};
  const Scene scene = make_scene("Still", {.joints = 3}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(s.status, StructureStatus::kDetermined);
  EXPECT_TRUE(names(s, channel_name(scene, 1)));
  EXPECT_EQ(s.joints.size(), 2U);
}

TEST(Determination, JointsThatMoveTogetherAreNamed) {
  RecordingOptions o = noisy();
  o.together = {{0, 2}};
  const Scene scene = make_scene("Together", {.joints = 4, .prismatic_share = 0.0}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(s.status, StructureStatus::kUndetermined);
  EXPECT_LT(s.probability, 0.6);
  EXPECT_TRUE(names(s, channel_name(scene, 0)));
  EXPECT_TRUE(names(s, channel_name(scene, 2)));
}

TEST(Determination, NoMarkersNoMotionNoOverlap) {
  const Scene scene = make_scene("Nothing", {.joints = 1}, noisy());
  const Structure none = find_structure(PoseTracks{}, scene.recording.log);
  EXPECT_EQ(none.status, StructureStatus::kUndetermined);
  ASSERT_EQ(none.links.size(), 1U);
  EXPECT_FALSE(none.doubts.empty());

  RecordingOptions still = noisy();
  still.still_joints = {0, 1};
  const Scene resting = make_scene("Resting", {.joints = 2}, still);
  const Structure rest = find_structure(resting.recording.tracks, resting.recording.log);
  EXPECT_EQ(rest.status, StructureStatus::kUndetermined);
  EXPECT_TRUE(rest.joints.empty());
  EXPECT_EQ(rest.links[0].markers.size(), 3U);

  JointLog elsewhere = scene.recording.log;
  for (double& t : elsewhere.times_s) t += 1000.0;
  const Structure apart = find_structure(scene.recording.tracks, elsewhere);
  EXPECT_EQ(apart.status, StructureStatus::kUndetermined);
  EXPECT_FALSE(apart.doubts.empty());
}

TEST(Determination, RareMarkersAreNamedNotPlaced) {
  Scene scene = make_scene("Rare", {.joints = 2}, noisy());
  PoseTrack rare;
  rare.id = TagId{77};
  rare.samples = {scene.recording.tracks.tracks[0].samples[3]};
  scene.recording.tracks.tracks.push_back(rare);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_TRUE(names(s, "tag_77"));
  EXPECT_EQ(s.joints.size(), 2U);
}

TEST(Determination, ProbabilitiesAreNumbers) {
  for (std::uint64_t salt = 0; salt < 4; ++salt) {
    RecordingOptions o;
    o.frames = 40;
    o.sigma_m = 0.03;
    o.sigma_rad = 10.0 * kDegree;
    o.flip_share = 0.2;
    Rng rng = Rng::from_name("Numbers", salt);
    const RandomRobot robot = random_robot({.joints = 4}, rng);
    const RobotRecording r = record(robot, o, rng);
    const Structure s = find_structure(r.tracks, r.log);
    EXPECT_GE(s.probability, 0.0);
    EXPECT_LE(s.probability, 1.0);
    EXPECT_TRUE(std::isfinite(s.runner_up_log_odds));
    EXPECT_TRUE(std::isfinite(s.time_offset_s));
    for (const StructureJoint& j : s.joints) {
      EXPECT_TRUE(j.T_parent_joint.matrix4().allFinite());
      EXPECT_TRUE(j.T_joint_child.matrix4().allFinite());
      EXPECT_TRUE(std::isfinite(j.log_odds));
    }
  }
}

}  // namespace
}  // namespace kinescope
