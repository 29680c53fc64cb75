// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/resting_base.h"

#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/model/kinematic_tree.h"
#include "tests/kinematics/structure/turned_pose.h"

namespace kinescope {
namespace {

// Camera - joint without a channel - marker 1 - joint of channel 0 - marker 2.
Structure moving_base() {
  Structure out;
  out.status = StructureStatus::kDetermined;
  out.links = {{}, {{TagId{1}}, {Pose{}}}, {{TagId{2}}, {Pose{}}}};
  StructureJoint below;
  below.parent_link = 0;
  below.child_link = 1;
  below.T_parent_joint = turned_pose(0.4, {0.1, 0.2, 1.0});
  below.T_joint_child = turned_pose(-0.7, {0.0, 0.3, 0.1});
  StructureJoint driven;
  driven.parent_link = 1;
  driven.child_link = 2;
  driven.channel = ChannelTerm{0, 1.0, 0.0};
  driven.T_parent_joint = turned_pose(1.1, {0.2, 0.0, 0.0});
  driven.T_joint_child = turned_pose(0.2, {0.0, 0.1, 0.0});
  out.joints = {below, driven};
  out.joint_values = Eigen::MatrixXd::Constant(3, 2, std::numeric_limits<double>::quiet_NaN());
  out.joint_values.col(0) << 0.01, 0.05, 0.02;
  return out;
}

JointLog log_of_one() {
  JointLog log;
  log.channels = {"q1"};
  return log;
}

// Of the camera, at a reading of the driven joint.
Pose marker_2(const Structure& structure, const Eigen::VectorXd& values) {
  const KinematicTree tree = structure_tree(structure, log_of_one());
  const Marker& marker = tree.markers.back();
  return forward_kinematics(tree, values)[marker.link.index()] * marker.T_link_marker;
}

TEST(RestingBase, TheRobotStaysWhereItMostlyStood) {
  const Structure moving = moving_base();
  const auto resting = with_base_at_rest(moving, log_of_one());
  ASSERT_TRUE(resting);
  ASSERT_EQ(resting->links.size(), 2U);
  ASSERT_EQ(resting->joints.size(), 1U);
  EXPECT_EQ(resting->joint_values.cols(), 1);
  EXPECT_EQ(resting->joints.front().parent_link, 0);
  EXPECT_EQ(resting->joints.front().child_link, 1);
  EXPECT_EQ(resting->links.front().markers, std::vector{TagId{1}});
  const Pose before = marker_2(moving, Eigen::Vector2d(0.02, 0.6));
  const Pose after = marker_2(*resting, Eigen::VectorXd::Constant(1, 0.6));
  EXPECT_LT(log_pose(before.inverse() * after).norm(), kExactProduct);
}

// A camera that drifts looks like a joint of whatever channel rises with time.
TEST(RestingBase, AChannelThatExplainsLessThanHalfDrivesNothing) {
  Structure driven = moving_base();
  driven.joints.front().channel = ChannelTerm{0, 1.0, 0.0};
  driven.joints.front().unexplained = 0.6;
  const auto resting = with_base_at_rest(driven, log_of_one());
  ASSERT_TRUE(resting);
  ASSERT_EQ(resting->joints.size(), 1U);
  EXPECT_TRUE(resting->joints.front().channel);
  driven.joints.front().unexplained = 0.4;
  EXPECT_FALSE(with_base_at_rest(driven, log_of_one()));
}

TEST(RestingBase, OtherStructuresStayAsTheyAre) {
  Structure driven = moving_base();
  driven.joints.front().channel = ChannelTerm{0, 1.0, 0.0};
  EXPECT_FALSE(with_base_at_rest(driven, log_of_one()));
  Structure seen = moving_base();
  seen.links.front() = {{TagId{0}}, {Pose{}}};
  EXPECT_FALSE(with_base_at_rest(seen, log_of_one()));
  Structure undriven = moving_base();
  undriven.joints.back().channel.reset();
  EXPECT_FALSE(with_base_at_rest(undriven, log_of_one()));
  EXPECT_FALSE(with_base_at_rest(Structure{}, log_of_one()));
}

}  // namespace
}  // namespace kinescope
