// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/resting_joint.h"

#include <vector>

#include <gtest/gtest.h>

#include "kinematics/model/kinematic_tree.h"
#include "tests/kinematics/structure/turned_pose.h"

namespace kinescope {
namespace {

// Camera - marker 0; joint of channel 0 - marker 5; joint of channel 1 - marker 2; joint of
// channel 2 - marker 7.
Structure arm_of_three() {
  Structure out;
  out.status = StructureStatus::kDetermined;
  out.links = {{{TagId{0}}, {turned_pose(0.3, {0.0, 0.1, 1.2})}},
               {{TagId{5}}, {Pose{}}},
               {{TagId{2}}, {Pose{}}},
               {{TagId{7}}, {Pose{}}}};
  for (int j = 0; j < 3; ++j) {
    StructureJoint joint;
    joint.parent_link = j;
    joint.child_link = j + 1;
    joint.channel = ChannelTerm{j, 1.0, 0.0};
    joint.offset = 0.1 * j;
    joint.travel = 1.0;
    joint.rotation_rms_rad = 1e-3;
    joint.translation_rms_m = 1e-4;
    joint.T_parent_joint = turned_pose(0.4 + j, {0.1, 0.2, 0.3 * j});
    joint.T_joint_child = turned_pose(-0.7 * j, {0.0, 0.3, 0.1});
    out.joints.push_back(joint);
  }
  return out;
}

JointLog log_at(const Eigen::Vector3d& reading) {
  JointLog log;
  log.channels = {"q0", "q1", "q2"};
  log.times_s = {0.0};
  log.values = reading.transpose();
  return log;
}

Pose marker_of(const Structure& structure, TagId id, const JointLog& log) {
  const KinematicTree tree = structure_tree(structure, log);
  Eigen::VectorXd values(static_cast<Eigen::Index>(tree.joints.size()));
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    values(static_cast<Eigen::Index>(j)) = usual_value(structure, j, log);
  }
  for (const Marker& marker : tree.markers) {
    if (marker.id == id)
      return forward_kinematics(tree, values)[marker.link.index()] * marker.T_link_marker;
  }
  ADD_FAILURE() << "no marker " << id.value;
  return {};
}

// Also where the united link takes its frame from a marker of the joint's child.
TEST(RestingJoint, EveryMarkerStaysWhereItStood) {
  const Structure moving = arm_of_three();
  const JointLog log = log_at({0.3, -0.2, 0.5});
  for (std::size_t joint = 0; joint < 3; ++joint) {
    const Structure resting = with_joint_at_rest(moving, joint, log);
    EXPECT_EQ(resting.links.size(), 3U);
    EXPECT_EQ(resting.joints.size(), 2U);
    EXPECT_EQ(resting.idle_channels, std::vector{static_cast<int>(joint)});
    for (const int id : {0, 2, 5, 7}) {
      const Pose before = marker_of(moving, TagId{id}, log);
      const Pose after = marker_of(resting, TagId{id}, log);
      EXPECT_LT(log_pose(before.inverse() * after).norm(), kExactProduct)
          << "tag " << id << " without joint " << joint;
    }
  }
}

TEST(RestingJoint, AChannelThatDrivesAnotherJointIsNotIdle) {
  Structure moving = arm_of_three();
  moving.joints[2].couplings = {{0, 0.5, 0.0}};
  EXPECT_TRUE(with_joint_at_rest(moving, 0, log_at({0.3, -0.2, 0.5})).idle_channels.empty());
}

// Marker 9 stands on the link between the joints of channels 1 and 2, which was passed over.
TEST(RestingJoint, AMarkerOnALinkThatWasPassedOverStaysWhereItStood) {
  Structure moving = arm_of_three();
  moving.links[2] = {};
  StructureJoint undoes = moving.joints[2];
  undoes.parent_link = 3;
  undoes.child_link = 4;
  undoes.T_parent_joint = turned_pose(2.0, {0.1, 0.0, 0.2});
  moving.joints.push_back(undoes);
  moving.links.push_back({{TagId{9}}, {Pose{}}});
  const JointLog log = log_at({0.3, -0.2, 0.5});
  EXPECT_FALSE(with_joint_undone(moving, 2, log));
  const auto simpler = with_joint_undone(moving, 3, log);
  ASSERT_TRUE(simpler);
  EXPECT_EQ(simpler->links[2].markers, std::vector{TagId{9}});
  EXPECT_TRUE(simpler->idle_channels.empty());
  for (const int id : {0, 5, 7, 9}) {
    const Pose before = marker_of(moving, TagId{id}, log);
    const Pose after = marker_of(*simpler, TagId{id}, log);
    EXPECT_LT(log_pose(before.inverse() * after).norm(), kExactProduct) << "tag " << id;
  }
}

TEST(RestingJoint, AJointHardlyMovesWithinTheErrorsOfItsPoses) {
  StructureJoint joint = arm_of_three().joints.front();
  EXPECT_FALSE(hardly_moves(joint));
  joint.travel = 2e-3;
  EXPECT_TRUE(hardly_moves(joint));
  joint.type = JointType::kPrismatic;
  EXPECT_FALSE(hardly_moves(joint));
}

}  // namespace
}  // namespace kinescope
