// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/rearrange.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/structure/idle_channels.h"
#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

// Recordings of tests/experiments/structure_grid, by cell and trial.
Scene scene_of(const std::string& cell, std::uint64_t trial, const RandomRobotOptions& robot,
               const RecordingOptions& recording) {
  Rng rng = Rng::from_name("structure_grid " + cell, trial);
  Scene scene;
  scene.robot = random_robot(robot, rng);
  scene.recording = record(scene.robot, recording, rng);
  return scene;
}

Scene hardly_moving(std::uint64_t trial) {
  RecordingOptions recording = noisy();
  recording.amplitude_rad = 0.02;
  return scene_of("stress amplitude 0.02", trial, {}, recording);
}

void expect_right(const Scene& scene) {
  const Structure found = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(described(found, scene.robot), described(scene));
}

// A slide of 4 mm, its two markers on one link at first, and its channel without a joint.
TEST(TakeLinksApart, WhereAChannelDrivesNothing) { expect_right(hardly_moving(31)); }

// The marker between two joints hung on the far side of both, as of one joint that is coupled.
TEST(TakeLinksApart, WhereTwoJointsPassForOne) { expect_right(hardly_moving(17)); }

TEST(TakeLinksApart, WhereTwoParallelAxesPassForOne) {
  RecordingOptions recording = noisy();
  recording.amplitude_rad = 0.1;
  recording.frames = 180;
  expect_right(
      scene_of("stress parallel axes 0.1 rad 6 s", 36, {.parallel_axes = true}, recording));
}

// Two slides along one axis, of which the second marker could as well hang by both on the base and
// the first on the second: bodies further out say nothing of which.
TEST(TakeLinksApart, NotForThePathsErrorsOfBodiesFurtherOut) {
  expect_right(scene_of("stress parallel axes", 48, {.parallel_axes = true}, noisy()));
}

// Every joint has the type and the channel of a true one; links without a marker have no name.
void expect_right_joints(const Scene& scene) {
  const Structure found = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(found.joints.size(), scene.robot.tree.joints.size());
  for (std::size_t k = 0; k < scene.robot.tree.joints.size(); ++k) {
    const StructureJoint* joint = joint_of(found, scene, k);
    ASSERT_NE(joint, nullptr) << "joint " << k;
    EXPECT_EQ(joint->type, scene.robot.tree.joints[k].type) << "joint " << k;
    EXPECT_TRUE(joint->couplings.empty()) << "joint " << k;
  }
}

Scene with_a_bare_link(std::uint64_t trial) {
  RandomRobotOptions robot;
  robot.unmarked_links = {3};
  return scene_of("stress one link without marker", trial, robot, noisy());
}

TEST(SeveralJoints, ASlideIsNoTurnAboutAnAxisFarAway) { expect_right_joints(with_a_bare_link(58)); }

TEST(SeveralJoints, TwoSlidesAreNoCoupledOne) { expect_right_joints(with_a_bare_link(47)); }

// One slide that leaves five times the noise, beside a channel that drives nothing.
TEST(SeveralJoints, ACoarseJointBesideAnIdleChannelIsTwo) {
  expect_right_joints(with_a_bare_link(114));
}

// Its flips keep to a plane, as if it turned; that motion is too small to be believed.
TEST(Rest, IsTakenWhereAJointWithoutAChannelIsNotBelieved) {
  RecordingOptions o = noisy();
  o.flip_share = 0.1;
  const Scene scene = scene_of("stress flips 0.1", 79, {}, o);
  const Structure found = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_TRUE(found.free_markers.empty());
  EXPECT_EQ(described(found, scene.robot), described(scene));
}

// -2 ln of 1 : 9 that it drives nothing, and of the choice that its joint would have had.
TEST(IdleChannels, CostWhatTheyCouldHaveDriven) {
  structure_search::Readings readings;
  readings.mean = {0.0, 0.0, 0.0};
  readings.rms = {1.0, 1.0, 0.0};
  EXPECT_EQ(structure_search::idle_cost(0, readings), 0.0);
  EXPECT_NEAR(structure_search::idle_cost(1, readings), 2.0 * std::log(9.0 * 3.0), 1e-12);
  EXPECT_NEAR(structure_search::idle_cost(2, readings), 4.0 * std::log(27.0) - 2.0 * std::log(2.0),
              1e-12);
  structure_search::GrownTree tree;
  tree.links.resize(1);
  EXPECT_EQ(structure_search::idle_channels(tree, readings), (std::vector<char>{1, 1, 0}))
      << "a channel that stands still drives nothing that is seen";
}

TEST(IdleChannels, DriveNothingByAMotionThatIsAsGoodAsNone) {
  structure_search::Readings readings;
  readings.mean = {0.0};
  readings.rms = {1.0};
  structure_search::GrownTree tree;
  tree.links.resize(1);
  tree.bodies.resize(1);
  tree.bodies[0].link = 0;
  structure_search::Attachment slide;
  slide.fit.model.joints.push_back(
      {.type = JointType::kPrismatic, .frame = {}, .terms = {{.channel = 0, .scale = 1e-3}}});
  slide.fit.scale_sigma = {1e-4};
  EXPECT_LT(structure_search::idle_change(tree, readings, 0, slide), -4.0);
  slide.fit.scale_sigma = {1e-3};
  EXPECT_EQ(structure_search::idle_change(tree, readings, 0, slide), 0.0);
}

}  // namespace
}  // namespace kinescope
