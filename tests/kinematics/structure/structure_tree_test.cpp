// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/model/kinematic_tree.h"
#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

// Noise-free tracks: what is left is the interpolation of the log (100 Hz) and where the search
// stops.
constexpr double kExactM = 2e-5;
constexpr double kExactRad = 5e-5;

RecordingOptions exact() {
  RecordingOptions o;
  o.sigma_m = 1e-9;
  o.sigma_rad = 1e-9;
  o.declared_noise = 1e5;  // 0.1 mm, 0.1 mrad
  o.frames = 300;
  return o;
}

// Largest error of all markers over some frames, with the tree's own joint values.
void expect_predicts(const Structure& s, const Scene& scene) {
  const KinematicTree tree = structure_tree(s, scene.recording.log);
  check_tree(tree);
  ASSERT_EQ(tree.markers.size(), scene.robot.tree.markers.size());
  const auto& times = scene.recording.tracks.times_s;
  const Eigen::MatrixXd readings = resample(scene.recording.log, times, s.time_offset_s);
  for (std::size_t f = 0; f < times.size(); f += 17) {
    const auto row = static_cast<Eigen::Index>(f);
    Eigen::VectorXd values(static_cast<Eigen::Index>(tree.joints.size()));
    for (std::size_t j = 0; j < tree.joints.size(); ++j) {
      const auto k = static_cast<Eigen::Index>(j);
      values(k) = s.joint_values(row, k);
      if (!s.joints[j].channel) continue;
      values(k) = s.joints[j].offset +
                  s.joints[j].channel->scale * readings(row, s.joints[j].channel->channel);
      for (const ChannelTerm& c : s.joints[j].couplings)
        values(k) += c.scale * readings(row, c.channel);
    }
    const auto found = forward_kinematics(tree, values);
    const auto poses =
        forward_kinematics(scene.robot.tree, scene.recording.joint_values.row(row).transpose());
    for (const Marker& m : scene.robot.tree.markers) {
      const Marker& mine = *tree.marker(m.id);
      const Pose truth = scene.robot.T_camera_base * poses[m.link.index()] * m.T_link_marker;
      const Pose predicted = found[mine.link.index()] * mine.T_link_marker;
      EXPECT_LT((truth.translation - predicted.translation).norm(), kExactM)
          << "tag " << m.id.value << " frame " << f;
      EXPECT_LT(angle_between(truth.rotation, predicted.rotation), kExactRad)
          << "tag " << m.id.value;
    }
  }
}

TEST(StructureTree, PredictsTheMarkersFromTheReadings) {
  const Scene scene =
      make_scene("Predicts", {.joints = 5, .tree = true, .markers_per_link = 2}, exact());
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  ASSERT_EQ(described(s, scene.robot), described(scene));
  expect_predicts(s, scene);
}

TEST(StructureTree, PredictsWithNegativeSignsTicksAndCouplings) {
  RecordingOptions o = exact();
  o.random_signs = true;
  o.channel_scale = 1000.0;
  o.coupling = 0.4;
  const Scene scene = make_scene("PredictsSigns", {.joints = 4}, o);
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  ASSERT_EQ(described(s, scene.robot), described(scene));
  expect_predicts(s, scene);
}

TEST(StructureTree, PredictsThroughLinksWithoutMarkers) {
  RandomRobotOptions robot;
  robot.joints = 4;
  robot.unmarked_links = {1, 3};
  robot.prismatic_share = 0.2;
  const Scene scene = make_scene("PredictsUnseen2", robot, exact());
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  ASSERT_EQ(s.joints.size(), 4U);
  expect_predicts(s, scene);
}

TEST(StructureTree, PredictsWithTheJointValuesWhereThereIsNoLog) {
  RandomRobotOptions robot;
  robot.joints = 2;
  robot.base_marker = false;
  Scene scene = make_scene("PredictsNoLog", robot, exact());
  scene.recording.log = JointLog{};
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  ASSERT_EQ(s.joints.size(), 2U);
  const KinematicTree tree = structure_tree(s, scene.recording.log);
  EXPECT_EQ(tree.joints[0].name, "joint1");
  for (std::size_t f = 0; f < scene.recording.tracks.times_s.size(); f += 17) {
    const auto row = static_cast<Eigen::Index>(f);
    const auto found = forward_kinematics(tree, s.joint_values.row(row).transpose());
    const auto poses =
        forward_kinematics(scene.robot.tree, scene.recording.joint_values.row(row).transpose());
    for (const Marker& m : scene.robot.tree.markers) {
      const Marker& mine = *tree.marker(m.id);
      const Pose truth = scene.robot.T_camera_base * poses[m.link.index()] * m.T_link_marker;
      const Pose predicted = found[mine.link.index()] * mine.T_link_marker;
      EXPECT_LT((truth.translation - predicted.translation).norm(), kExactM);
    }
  }
  // Value 0 is the mean posture.
  EXPECT_NEAR(s.joint_values.col(0).mean(), 0.0, 0.02);
}

TEST(StructureTree, OriginsLieOnTheAxisNextToTheChild) {
  const Scene scene = make_scene("Origins", {.joints = 3, .prismatic_share = 0.0}, exact());
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  ASSERT_EQ(s.joints.size(), 3U);
  for (const StructureJoint& j : s.joints) {
    // Turning about z moves nothing along z: the marker is level with the origin.
    EXPECT_NEAR(j.T_joint_child.translation.z(), 0.0, 1e-9);
  }
}

TEST(StructureTree, NamesAreSanitisedAndUnique) {
  Scene scene = make_scene("Names", {.joints = 3}, exact());
  scene.recording.log.channels = {"arm/1", "arm 1", "arm.2"};
  const Structure s = find_structure(scene.recording.tracks, scene.recording.log);
  ASSERT_EQ(s.joints.size(), 3U);
  const KinematicTree tree = structure_tree(s, scene.recording.log);
  check_tree(tree);
  std::vector<std::string> names;
  for (const Joint& j : tree.joints) {
    names.push_back(j.name);
    EXPECT_FALSE(j.channel.empty());
    EXPECT_FALSE(j.limits);
  }
  std::ranges::sort(names);
  EXPECT_EQ(names, (std::vector<std::string>{"arm_1", "arm_1_2", "arm_2"}));
  EXPECT_EQ(tree.links[0].name, "base");
  EXPECT_EQ(tree.links[1].name, "link1");
}

}  // namespace
}  // namespace kinescope
