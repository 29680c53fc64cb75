// SPDX-License-Identifier: Apache-2.0
#include "kinematics/urdf/calibrated_urdf.h"

#include <gtest/gtest.h>
#include <urdf_parser/urdf_parser.h>

#include "kinematics/urdf/urdf.h"
#include "tests/kinematics/model/random_tree.h"
#include "tests/kinematics/urdf/tree_difference.h"

namespace kinescope {
namespace {

// Everything that a robot's file holds beside its kinematics, written as people write it.
constexpr const char* kDrawing = R"(<?xml version='1.0'?>
<!-- <joint name="elbow"> of the maker: "do not touch" > -->
<robot name="arm" xmlns:xacro="http://ros.org/wiki/xacro">
  <material name="steel"><color rgba=".5 .5 .5 1"/></material>
  <link name="base_link"><visual><geometry><mesh filename="package://arm/a>b.stl"/></geometry></visual></link>
  <link name="upper">
    <inertial><origin xyz="0 0 0.150" rpy="0 0 0"/><mass value="2.50"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.001"/></inertial>
    <collision><origin xyz="0 0 .15"/><geometry><cylinder radius="0.04" length="0.3"/></geometry></collision>
  </link>
  <link name="fore"/> <link name="tool0"/> <link name="tag_4"/>
  <joint type="revolute" name="shoulder">
	<limit effort="87" velocity="2.1750" upper="2.8973" lower="-2.8973"/><dynamics damping="0.5" friction="0.1"/>
    <parent link="base_link"/><child link="upper"/><axis xyz="0 0 1"></axis>
    <origin   rpy="0 0 0"   xyz="0 0 0.3330"></origin><safety_controller k_velocity="40"/>
  </joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/></joint>
  <joint name="tool" type="fixed"><parent link="fore"/><child link="tool0"/><origin xyz="0 0 .1070"/></joint>
  <joint name="paper" type="fixed"><parent link="fore"/><child link="tag_4"/><origin xyz="0 0 .05"/></joint>
  <transmission name="t"><joint name="elbow"><hardwareInterface>x</hardwareInterface></joint></transmission>
  <gazebo reference="fore"><![CDATA[ <origin xyz="9 9 9"/> ]]><mu1>0.20</mu1></gazebo>
  <ros2_control name="arm" type="system"><joint name="shoulder"><command_interface name="position"/></joint></ros2_control>
</robot>
<!-- end -->
)";

KinematicTree moved(KinematicTree tree, Rng& rng) {
  for (Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed) continue;
    joint.T_parent_joint = joint.T_parent_joint * random_pose(rng);
    joint.axis = rng.unit3();
  }
  for (Marker& marker : tree.markers) marker.T_link_marker = random_pose(rng);
  return tree;
}

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), with);
}

TEST(CalibratedUrdf, ForwardKinematicsIsThatOfTheCalibratedTree) {
  Rng rng = Rng::from_name("CalibratedUrdf.ForwardKinematics");
  for (int robot = 0; robot < 30; ++robot) {
    const KinematicTree drawn = random_tree(rng, 1 + rng.index(10), rng.index(4));
    const KinematicTree calibrated = moved(drawn, rng);
    const std::string text = with_calibrated_joints(write_urdf(drawn), "memory", calibrated);
    const KinematicTree back = parse_urdf(text, "memory");
    for (int posture = 0; posture < 20; ++posture)
      EXPECT_LT(worst_difference(calibrated, back, random_values(rng, calibrated)), kExact);
  }
}

TEST(CalibratedUrdf, OnlyTagsOfJointsThatMovedChange) {
  KinematicTree tree = parse_urdf(kDrawing, "memory");
  tree.joints[tree.joint("shoulder")->index()].T_parent_joint.translation.x() = 0.001;
  tree.joints[tree.joint("elbow")->index()].axis = Eigen::Vector3d::UnitY();
  tree.joints[tree.joint("elbow")->index()].T_parent_joint.translation.z() = 0.31;
  tree.markers.front().T_link_marker.translation.y() = 0.002;
  std::string expected = replaced(kDrawing, R"(<origin   rpy="0 0 0"   xyz="0 0 0.3330">)",
                                  R"(<origin xyz="0.001 0 0.333" rpy="0 0 0">)");
  expected =
      replaced(expected, R"(<joint name="elbow" type="continuous">)",
               R"(<joint name="elbow" type="continuous"><origin xyz="0 0 0.31" rpy="0 0 0"/>)"
               R"(<axis xyz="0 1 0"/>)");
  expected = replaced(expected, R"(<child link="tag_4"/><origin xyz="0 0 .05"/>)",
                      R"(<child link="tag_4"/><origin xyz="0 0.002 0.05" rpy="0 0 0"/>)");
  const std::string written = with_calibrated_joints(kDrawing, "memory", tree);
  EXPECT_EQ(written, expected);
  const auto whole = urdf::parseURDF(written);  // all of it, not the kinematic part alone
  ASSERT_NE(whole, nullptr);
  EXPECT_EQ(whole->getLink("upper")->inertial->mass, 2.5);
  EXPECT_EQ(whole->getJoint("shoulder")->limits->upper, 2.8973);
}

TEST(CalibratedUrdf, ATreeThatIsTheDrawingChangesNoByte) {
  const KinematicTree tree = parse_urdf(kDrawing, "memory");
  EXPECT_EQ(with_calibrated_joints(kDrawing, "memory", tree), kDrawing);
}

// A camera that a calibration adds has no joint in the file.
TEST(CalibratedUrdf, JointsAndMarkersThatTheFileLacksStayOut) {
  KinematicTree tree = parse_urdf(kDrawing, "memory");
  tree.links.push_back({"camera_link"});
  Joint joint;
  joint.name = "camera_joint";
  joint.child = LinkId{static_cast<int>(tree.links.size()) - 1};
  joint.parent = LinkId{0};
  tree.joints.push_back(joint);
  tree.markers.push_back({.id = TagId{9}, .link = LinkId{0}, .T_link_marker = {}});
  EXPECT_EQ(with_calibrated_joints(kDrawing, "memory", tree), kDrawing);
}

TEST(CalibratedUrdf, AJointOfAnotherRobotIsAnError) {
  KinematicTree tree = parse_urdf(kDrawing, "memory");
  tree.joints[tree.joint("elbow")->index()].type = JointType::kPrismatic;
  EXPECT_THROW(static_cast<void>(with_calibrated_joints(kDrawing, "memory", tree)),
               std::logic_error);
}

}  // namespace
}  // namespace kinescope
