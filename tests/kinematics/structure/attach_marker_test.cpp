// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/attach_marker.h"

#include <map>

#include <gtest/gtest.h>

#include "kinematics/model/kinematic_tree.h"
#include "tests/kinematics/structure/turned_pose.h"

namespace kinescope {
namespace {

StructureJoint joint_between(int parent, int child, double turn) {
  StructureJoint out;
  out.parent_link = parent;
  out.child_link = child;
  out.channel = ChannelTerm{child - 1, 1.0, 0.0};
  out.T_parent_joint = turned_pose(turn, {0.2, 0.1 * turn, 1.0});
  out.T_joint_child = turned_pose(-2.0 * turn, {0.0, 0.1, 0.3 * turn});
  return out;
}

// Camera and marker 1 - joint - nothing - joint - marker 7; marker 5 is free.
Structure structure_with_a_free_marker() {
  Structure out;
  out.status = StructureStatus::kDetermined;
  out.links = {{{TagId{1}}, {turned_pose(0.5, {0.0, 0.0, 1.0})}}, {}, {{TagId{7}}, {Pose{}}}};
  out.joints = {joint_between(0, 1, 0.4), joint_between(1, 2, -0.9)};
  out.free_markers = {TagId{5}};
  out.doubts = {{"tag 5 moves, but by no joint that could be found", "", {"tag_5"}},
                {"the time offset", "", {"q1"}}};
  return out;
}

JointLog log_of_two() {
  JointLog log;
  log.channels = {"q1", "q2"};
  return log;
}

std::map<int, Pose> markers_in_camera(const Structure& structure) {
  const KinematicTree tree = structure_tree(structure, log_of_two());
  const std::vector<Pose> links = forward_kinematics(tree, Eigen::Vector2d(0.3, -0.7));
  std::map<int, Pose> out;
  for (const Marker& marker : tree.markers)
    out[marker.id.value] = links[marker.link.index()] * marker.T_link_marker;
  return out;
}

class AttachMarker : public ::testing::TestWithParam<int> {};

TEST_P(AttachMarker, PutsItOnTheLinkAndMovesNoOther) {
  const Structure before = structure_with_a_free_marker();
  const Pose T_link_marker = turned_pose(1.3, {0.05, -0.02, 0.1});
  const Structure after = with_marker_on(before, TagId{5}, GetParam(), T_link_marker);
  std::map<int, Pose> expected = markers_in_camera(before);
  const std::vector<Pose> links =
      forward_kinematics(structure_tree(before, log_of_two()), Eigen::Vector2d(0.3, -0.7));
  expected[5] = links[static_cast<std::size_t>(GetParam())] * T_link_marker;
  const std::map<int, Pose> found = markers_in_camera(after);
  ASSERT_EQ(found.size(), expected.size());
  for (const auto& [id, T] : expected)
    EXPECT_LT((found.at(id).matrix4() - T.matrix4()).norm(), kExactProduct) << "tag " << id;
  EXPECT_TRUE(after.free_markers.empty());
  ASSERT_EQ(after.doubts.size(), 1U);
  EXPECT_EQ(after.doubts.front().names.front(), "q1");
}

INSTANTIATE_TEST_SUITE_P(OnTheBaseOnALinkWithoutAndBeforeAnother, AttachMarker,
                         ::testing::Values(0, 1, 2));

}  // namespace
}  // namespace kinescope
