// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/slight_turn.h"

#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

constexpr double kRadius = 10.0;      // m
constexpr double kRadPerUnit = 0.01;  // of the channel

// One joint that turns by 1.1 deg: its marker moves along an arc of 0.2 m.
Structure slight_turn() {
  Structure out;
  out.links = {{{TagId{0}}, {Pose{}}}, {{TagId{1}}, {Pose{}}}};
  StructureJoint joint;
  joint.child_link = 1;
  joint.channel = ChannelTerm{0, kRadPerUnit, 0.0};
  joint.offset = -kRadPerUnit;
  joint.travel = 2.0 * kRadPerUnit;
  joint.T_parent_joint = {exp_rotation({0.3, -0.2, 0.1}), {0.1, 0.2, 1.5}};
  joint.T_joint_child = {exp_rotation({0.0, 0.4, 0.0}), {kRadius, 0.0, 0.1}};
  out.joints = {joint};
  return out;
}

JointLog readings() {
  JointLog log;
  log.times_s = {0.0, 1.0, 2.0, 3.0, 4.0};
  log.channels = {"q"};
  log.values.resize(5, 1);
  log.values << 0.0, 0.5, 1.0, 1.5, 2.0;
  return log;
}

Pose marker_at(const StructureJoint& joint, double reading) {
  const double value = joint.channel->scale * reading + joint.offset;
  return joint.T_parent_joint * joint_motion(joint.type, Eigen::Vector3d::UnitZ(), value) *
         joint.T_joint_child;
}

TEST(SlightTurn, ASlideAlongTheTangentIsWhereTheTurnIs) {
  const Structure turn = slight_turn();
  const auto slide = with_slide_for_slight_turn(turn, 0, readings());
  ASSERT_TRUE(slide);
  EXPECT_EQ(slide->joints[0].type, JointType::kPrismatic);
  EXPECT_NEAR(slide->joints[0].channel->scale, kRadius * kRadPerUnit, 1e-12);
  for (const double reading : {0.0, 1.0, 2.0}) {
    const Pose a = marker_at(turn.joints[0], reading);
    const Pose b = marker_at(slide->joints[0], reading);
    const double angle = kRadPerUnit * (reading - 1.0);
    const double sagitta = 0.5 * kRadius * angle * angle;
    EXPECT_NEAR((a.translation - b.translation).norm(), sagitta, 1e-5) << reading;
    EXPECT_NEAR(angle_between(a.rotation, b.rotation), std::abs(angle), 1e-7) << reading;
  }
}

TEST(SlightTurn, OtherJointsStayAsTheyAre) {
  Structure wide = slight_turn();
  wide.joints[0].travel = 0.2;
  EXPECT_FALSE(with_slide_for_slight_turn(wide, 0, readings()));
  Structure slide = slight_turn();
  slide.joints[0].type = JointType::kPrismatic;
  EXPECT_FALSE(with_slide_for_slight_turn(slide, 0, readings()));
  Structure undriven = slight_turn();
  undriven.joints[0].channel.reset();
  EXPECT_FALSE(with_slide_for_slight_turn(undriven, 0, readings()));
}

}  // namespace
}  // namespace kinescope
