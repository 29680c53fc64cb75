// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/structure.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

void expect_right(const Structure& s, const Scene& scene) {
  EXPECT_EQ(described(s, scene.robot), described(scene)) << s.runner_up;
  EXPECT_TRUE(s.free_markers.empty());
  EXPECT_EQ(s.status, StructureStatus::kDetermined);
  EXPECT_GT(s.probability, 0.99);
}

TEST(FindStructure, ChainOfTurnsAndSlides) {
  const Scene scene = make_scene("Chain", {.joints = 6}, noisy());
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  expect_right(s, scene);
  for (const StructureJoint& j : s.joints) {
    EXPECT_NEAR(j.channel->scale, 1.0, std::max(0.004, 4.0 * j.channel->scale_sigma));
    EXPECT_GT(j.log_odds, 4.6);
    EXPECT_FALSE(j.runner_up.empty());
    EXPECT_TRUE(j.couplings.empty());
  }
}

TEST(FindStructure, TreeWithTwoMarkersALink) {
  const Scene scene =
      make_scene("Tree", {.joints = 7, .tree = true, .markers_per_link = 2}, noisy());
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  expect_right(s, scene);
  for (const StructureLink& link : s.links) {
    ASSERT_EQ(link.markers.size(), 2U);
    EXPECT_LT(link.markers[0], link.markers[1]);
    const Marker& a = *scene.robot.tree.marker(link.markers[0]);
    const Marker& b = *scene.robot.tree.marker(link.markers[1]);
    // Link 0's markers are placed in the camera's frame, the others' in the first marker's.
    const Pose truth = a.T_link_marker.inverse() * b.T_link_marker;
    const Pose found = link.T_reference_marker[0].inverse() * link.T_reference_marker[1];
    EXPECT_LT((truth.translation - found.translation).norm(), 2e-3);
    EXPECT_LT(angle_between(truth.rotation, found.rotation), 0.01);
  }
}

// Corners show a pose far better across the line of sight than along it, and one marker of a link
// far better than the other: what a link's joint leaves open by the one is no motion of the other.
TEST(FindStructure, MarkersThatAreSeenDifferentlyWellShareALink) {
  for (const double corner_px : {0.1, 0.3, 1.0}) {
    for (int seed = 1; seed <= 4; ++seed) {
      RecordingOptions o;
      o.corner_px = corner_px;
      const Scene scene =
          make_scene("Shared" + std::to_string(seed), {.joints = seed, .markers_per_link = 3}, o);
      const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
      SCOPED_TRACE(std::to_string(corner_px) + " px, seed " + std::to_string(seed));
      expect_right(s, scene);
      for (const StructureLink& link : s.links) EXPECT_EQ(link.markers.size(), 3U);
    }
  }
}

TEST(FindStructure, WithoutAMarkerOnTheBase) {
  const Scene scene = make_scene("NoBase", {.joints = 4, .base_marker = false}, noisy());
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  expect_right(s, scene);
  EXPECT_TRUE(s.links[0].markers.empty());
}

TEST(FindStructure, AChannelThatDrivesTwoJointsIsADoubt) {
  RecordingOptions o = noisy();
  o.together = {{0, 2}};
  o.shuffle_channels = false;
  Scene scene = make_scene("Linkage", {.joints = 3, .prismatic_share = 0.0}, o);
  // The third joint has no channel of its own: one motor moves it and the first.
  JointLog& log = scene.recording.log;
  ASSERT_EQ(log.channels.size(), 3U);
  const std::string motor = log.channels[0];
  log.channels.pop_back();
  log.values.conservativeResize(Eigen::NoChange, 2);
  const Structure s = find_structure(scene.recording.tracks, log);
  ASSERT_EQ(s.joints.size(), 3U);
  const auto doubt = std::ranges::find_if(
      s.doubts, [](const StructureDoubt& d) { return d.what.ends_with("drives 2 joints"); });
  ASSERT_NE(doubt, s.doubts.end());
  EXPECT_EQ(doubt->names, std::vector<std::string>{motor});
}

// One motor moves both fingers by a few millimetres: two joints, none of them at rest.
TEST(FindStructure, SmallFingersOfOneMotorAreTwoJoints) {
  RecordingOptions o;
  o.sigma_m = 2e-4;
  o.sigma_rad = 0.05 * kDegree;
  o.shuffle_channels = false;
  o.prismatic_m_per_rad = 0.01;
  o.together = {{2, 3}};
  Rng rng = Rng::from_name("Fingers");
  Scene scene;
  scene.robot = random_robot({.joints = 4, .prismatic_share = 0.0}, rng);
  // Both fingers slide on the second link.
  for (const std::size_t k : {2U, 3U}) {
    scene.robot.tree.joints[k].type = JointType::kPrismatic;
    scene.robot.tree.joints[k].parent = scene.robot.tree.joints[1].child;
  }
  scene.recording = record(scene.robot, o, rng);
  JointLog& log = scene.recording.log;
  log.channels.pop_back();
  log.values.conservativeResize(Eigen::NoChange, 3);
  scene.recording.channel_of_joint[3] = scene.recording.channel_of_joint[2];
  const Structure s = find_structure(scene.recording.tracks, log);
  expect_right(s, scene);
}

TEST(FindStructure, IdleChannelsAreNamed) {
  RecordingOptions o = noisy();
  o.idle_channels = 2;
  const Scene scene = make_scene("Idle", {.joints = 4}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  expect_right(s, scene);
  std::vector<int> idle;
  for (int c = 0; c < 6; ++c) {
    const auto& used = scene.recording.channel_of_joint;
    if (std::ranges::find(used, c) == used.end()) idle.push_back(c);
  }
  EXPECT_EQ(s.idle_channels, idle);
}

TEST(FindStructure, TicksSignsFlipsAndALagTogether) {
  RecordingOptions o = noisy();
  o.ticks = o.random_signs = true;
  o.flip_share = 0.1;
  o.lag_s = 0.37;
  const Scene scene = make_scene("TicksSignsFlipsLag", {.joints = 5}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  expect_right(s, scene);
  for (std::size_t k = 0; k < 5; ++k) {
    const StructureJoint* j = joint_of(s, scene, k);
    ASSERT_NE(j, nullptr);
    // Scales are always positive: the axis turns round instead.
    EXPECT_GT(j->channel->scale, 0.0);
    EXPECT_NEAR(j->channel->scale / std::abs(scene.recording.scale_of_joint[k]), 1.0, 0.01);
    EXPECT_EQ(j->offset, 0.0);
  }
  EXPECT_GT(s.time_offset_sigma_s, 0.0);
  // 600 frames at 3 mm and 0.5 deg tell the lag to about 1 ms.
  EXPECT_LT(s.time_offset_sigma_s, 5e-3);
  EXPECT_NEAR(s.time_offset_s, 0.37, std::max(5e-3, 5.0 * s.time_offset_sigma_s));
}

TEST(FindStructure, CouplingsAreFoundWithTheirRatio) {
  RecordingOptions o = noisy();
  o.coupling = 0.3;
  const Scene scene = make_scene("Coupling", {.joints = 4, .prismatic_share = 0.0}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  expect_right(s, scene);
  for (std::size_t k = 0; k < 4; ++k) {
    const StructureJoint* j = joint_of(s, scene, k);
    ASSERT_NE(j, nullptr);
    if (k == 0) {
      EXPECT_TRUE(j->couplings.empty());
      continue;
    }
    ASSERT_EQ(j->couplings.size(), 1U);
    EXPECT_EQ(j->couplings[0].channel, scene.recording.channel_of_joint[k - 1]);
    EXPECT_NEAR(j->couplings[0].scale, 0.3, 0.02);
  }
}

TEST(FindStructure, LinkWithoutAMarker) {
  RandomRobotOptions robot;
  robot.joints = 4;
  robot.prismatic_share = 0.0;
  robot.unmarked_links = {2};
  const Scene scene = make_scene("Unmarked", robot, noisy());
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  ASSERT_EQ(s.joints.size(), 4U);
  ASSERT_EQ(s.links.size(), 5U);
  // The link between is the one the channel of joint 2 leads to.
  const StructureJoint* second = joint_of(s, scene, 1);
  const StructureJoint* third = joint_of(s, scene, 2);
  ASSERT_NE(second, nullptr);
  ASSERT_NE(third, nullptr);
  EXPECT_EQ(second->child_link, third->parent_link);
  EXPECT_TRUE(s.links[static_cast<std::size_t>(second->child_link)].markers.empty());
  EXPECT_GT(s.probability, 0.99);
}

TEST(FindStructure, OrderOfMarkersAndChannelsDoesNotMatter) {
  RecordingOptions o = noisy();
  o.missing_share = 0.1;
  const Scene scene = make_scene("Order", {.joints = 4}, o);
  const Structure first = find_structure(scene.recording.tracks, scene.recording.log);
  PoseTracks tracks = scene.recording.tracks;
  std::ranges::reverse(tracks.tracks);
  for (PoseTrack& t : tracks.tracks) std::ranges::reverse(t.samples);
  JointLog log = scene.recording.log;
  std::ranges::reverse(log.channels);
  log.values = scene.recording.log.values.rowwise().reverse();
  const Structure second = find_structure(tracks, log);
  ASSERT_EQ(first.joints.size(), second.joints.size());
  EXPECT_EQ(first.probability, second.probability);
  EXPECT_EQ(first.runner_up, second.runner_up);
  EXPECT_EQ(first.time_offset_s, second.time_offset_s);
  for (std::size_t j = 0; j < first.joints.size(); ++j) {
    const StructureJoint& a = first.joints[j];
    const StructureJoint& b = second.joints[j];
    EXPECT_EQ(a.type, b.type);
    EXPECT_EQ(a.parent_link, b.parent_link);
    EXPECT_EQ(a.channel->channel, 3 - b.channel->channel);
    // To the last bit.
    EXPECT_EQ(a.channel->scale, b.channel->scale);
    EXPECT_EQ(a.T_parent_joint.translation, b.T_parent_joint.translation);
    EXPECT_EQ(a.log_odds, b.log_odds);
  }
}

TEST(FindStructure, BacklashCostsNoJoint) {
  RecordingOptions o = noisy();
  o.backlash_rad = 5.0 * kDegree;
  const Scene scene = make_scene("Backlash", {.joints = 4}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(described(s, scene.robot), described(scene));
}

TEST(FindStructure, SmallMotion) {
  RecordingOptions o = noisy();
  o.amplitude_rad = 0.05;
  const Scene scene = make_scene("Small", {.joints = 5}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  expect_right(s, scene);
}

TEST(FindStructure, PosturesMeasuredAtRest) {
  RecordingOptions o;
  o.rate_hz = 0.05;
  o.log_rate_hz = 0.05;
  o.frames = 60;
  Scene scene = make_scene("AtRest", {.joints = 4}, o);
  // The log has the frames' own stamps.
  JointLog log;
  log.times_s = scene.recording.tracks.times_s;
  log.channels = scene.recording.log.channels;
  log.values.resize(60, 4);
  for (std::size_t k = 0; k < 4; ++k) {
    log.values.col(scene.recording.channel_of_joint[k]) =
        scene.recording.joint_values.col(static_cast<Eigen::Index>(k)) /
        scene.recording.scale_of_joint[k];
  }
  const Structure s = find_structure(scene.recording.tracks, log);
  EXPECT_EQ(described(s, scene.robot), described(scene));
  EXPECT_EQ(s.time_offset_s, 0.0);
}

}  // namespace
}  // namespace kinescope
