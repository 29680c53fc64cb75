// SPDX-License-Identifier: Apache-2.0
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/urdf/urdf.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

/// The message of the Error that parsing ends with; its exit code is that of an unreadable input.
std::string refusal(std::string_view text) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  std::string message = "accepted";
  try {
    static_cast<void>(parse_urdf(text, "robot.urdf"));
  } catch (const Error& error) {
    message = error.what();
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
  }
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  return message;
}

/// A robot of two links; `joint` stands in line 4.
std::string robot(std::string_view joint) {
  return fmt::format("<robot name=\"r\">\n<link name=\"a\"/>\n<link name=\"b\"/>\n{}\n</robot>\n",
                     joint);
}

constexpr std::string_view kLimit = R"(<limit lower="-1" upper="1" effort="1" velocity="1"/>)";

std::string joint(std::string_view inside, std::string_view type = "revolute") {
  return robot(fmt::format(
      R"(<joint name="j" type="{}"><parent link="a"/><child link="b"/>{}</joint>)", type, inside));
}

TEST(Urdf, AMimickingJointNamesTheOtherAsItsChannel) {
  const std::string follower = joint(
      std::string(kLimit) + R"(<mimic joint="finger" multiplier="-2" offset="0.5"/>)", "prismatic");
  const KinematicTree tree = parse_urdf(follower, "robot.urdf");
  ASSERT_EQ(tree.joints.size(), 1U);
  EXPECT_EQ(tree.joints[0].channel, "finger");
  EXPECT_EQ(tree.joints[0].scale, -2.0);
  EXPECT_EQ(tree.joints[0].offset, 0.5);
  EXPECT_NE(refusal(joint(std::string(kLimit) + "<mimic multiplier=\"1\"/>")), "accepted");
}

TEST(UrdfRefuses, WhatIsNoXml) {
  EXPECT_EQ(refusal(""), "robot.urdf: is empty (name a URDF file)");
  EXPECT_EQ(refusal(" \n"), "robot.urdf: is empty (name a URDF file)");
  EXPECT_TRUE(refusal("hello").starts_with("robot.urdf:1: is not well-formed XML"));
  EXPECT_TRUE(refusal("<robot name=\"r\">\n<link name=\"a\"/>\n<joint na")
                  .starts_with("robot.urdf:3: is not well-formed XML"));
  EXPECT_TRUE(refusal("<sdf/>").starts_with("robot.urdf: is no URDF: its root element is <sdf>"));
}

TEST(UrdfRefuses, EveryTruncation) {
  const std::string whole = joint(kLimit);
  for (std::size_t size = 1; size + 2 < whole.size(); size += 7) {
    EXPECT_NE(refusal(whole.substr(0, size)), "accepted") << size;
  }
  EXPECT_EQ(refusal(whole), "accepted");
}

TEST(UrdfRefuses, WhatIsNoTree) {
  EXPECT_EQ(refusal("<robot name=\"r\"/>"), "robot.urdf:1: the robot has no link (add its links)");
  EXPECT_EQ(refusal(robot("")),
            "robot.urdf:3: two links have no parent: 'a' and 'b' (join them by a fixed joint)");
  const std::string back_and_forth = robot(
      R"(<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
         <joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint>)");
  EXPECT_TRUE(refusal(back_and_forth).starts_with("robot.urdf:4: the joints form a loop"));
  const std::string side_loop = robot(
      R"(<link name="root"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
         <joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint>)");
  EXPECT_TRUE(refusal(side_loop).starts_with(
      "robot.urdf:4: joint 'j' is part of a loop that does not reach the root 'root'"));
  const std::string two_parents = robot(
      R"(<link name="c"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
         <joint name="k" type="fixed"><parent link="c"/><child link="b"/></joint>)");
  EXPECT_TRUE(
      refusal(two_parents)
          .starts_with("robot.urdf:5: link 'b' has two parents, by the joints 'j' and 'k'"));
}

TEST(UrdfRefuses, NamesThatAreMissingOrTaken) {
  EXPECT_EQ(refusal("<robot/>"), "robot.urdf:1: a <robot> has no name (give it a name attribute)");
  EXPECT_TRUE(refusal(robot("<link name=\"a\"/>"))
                  .starts_with("robot.urdf:4: a link 'a' stands in line 2 already"));
  EXPECT_TRUE(
      refusal(robot(R"(<joint name="j" type="fixed"><parent link="a"/><child link="q"/></joint>)"))
          .starts_with("robot.urdf:4: joint 'j': its child link 'q' is not in the file"));
  EXPECT_TRUE(refusal(robot(R"(<joint name="j" type="fixed"><child link="b"/></joint>)"))
                  .starts_with("robot.urdf:4: joint 'j' names no parent link"));
  EXPECT_TRUE(refusal(robot(R"(<link/>)")).starts_with("robot.urdf:4: a <link> has no name"));
}

TEST(UrdfRefuses, NamesThatAreNoText) {
  for (const char* name : {"j\xC3\xC3j", "j\xFF", "j\x01"}) {
    EXPECT_TRUE(
        refusal(robot(fmt::format(
                    R"(<joint name="{}" type="fixed"><parent link="a"/><child link="b"/></joint>)",
                    name)))
            .starts_with("robot.urdf:4: the name of a <joint> holds bytes that are no text"));
  }
  EXPECT_EQ(refusal(robot(R"(<joint name="Gelenk_ö" type="fixed"><parent link="a"/>)"
                          R"(<child link="b"/></joint>)")),
            "accepted");
}

TEST(UrdfRefuses, TypesItDoesNotKnow) {
  for (const char* type : {"planar", "floating", "ball", ""}) {
    EXPECT_EQ(
        refusal(joint("", type)),
        fmt::format("robot.urdf:4: joint 'j' has the type '{}' (use fixed, revolute, continuous "
                    "or prismatic)",
                    type));
  }
}

TEST(UrdfRefuses, NumbersThatAreNone) {
  const auto with_limit = [](std::string_view inside) {
    return joint(fmt::format("{}{}", inside, kLimit));
  };
  EXPECT_EQ(refusal(with_limit(R"(<origin xyz="0 nan 0"/>)")),
            "robot.urdf:4: joint 'j': <origin xyz=\"0 nan 0\"> holds 'nan', not a finite number "
            "(correct it)");
  EXPECT_NE(refusal(with_limit(R"(<origin rpy="0 inf 0"/>)")), "accepted");
  EXPECT_NE(refusal(with_limit(R"(<origin rpy="0 1e999 0"/>)")), "accepted");
  EXPECT_NE(refusal(with_limit(R"(<origin rpy="0 0"/>)")).find("has 2 numbers, not 3"),
            std::string::npos);
  EXPECT_NE(refusal(with_limit(R"(<origin xyz="0 ${d} 0"/>)")).find("run xacro on the file first"),
            std::string::npos);
  for (const char* axis : {R"(<axis xyz="0 0 0"/>)", R"(<axis/>)", R"(<axis xyr="0 0 1"/>)"}) {
    EXPECT_NE(refusal(with_limit(axis)).find("the axis has no length"), std::string::npos) << axis;
  }
  EXPECT_NE(refusal(with_limit(R"(<axis xyz="0 0 1e200"/>)")).find("a length of 1e+200"),
            std::string::npos);
  EXPECT_NE(refusal(joint(R"(<limit lower="1" upper="-1" effort="1" velocity="1"/>)"))
                .find("the lower limit 1 is above the upper limit -1"),
            std::string::npos);
}

TEST(Urdf, AHingeWithoutLimitsHasNone) {
  for (const char* limit :
       {"", R"(<limit effort="5" velocity="1"/>)", R"(<limit velocity="2"/>)"}) {
    for (const char* type : {"revolute", "prismatic"}) {
      const KinematicTree tree = parse_urdf(joint(limit, type), "robot.urdf");
      ASSERT_EQ(tree.joints.size(), 1U);
      EXPECT_FALSE(tree.joints[0].limits) << limit;
    }
  }
  const KinematicTree tree = parse_urdf(joint(R"(<limit lower="-1" upper="1"/>)"), "robot.urdf");
  EXPECT_EQ(tree.joints[0].limits, (JointLimits{-1.0, 1.0}));
}

TEST(UrdfRefuses, AFileThatIsNotThere) {
  EXPECT_THROW(static_cast<void>(read_urdf("no/such/robot.urdf")), Error);
}

constexpr std::string_view kUntidy = R"(<?xml version="1.0"?>
<!-- made by xacro -->
<robot name="untidy" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="leftover" value="1"/>
  <link name="world"/>
  <link name="base"><inertial><mass value="-1"/></inertial></link>
  <link name="arm">
    <visual><geometry><mesh filename="package://arm/meshes/arm.dae" scale="1 1 1"/></geometry>
      <material name="never_declared"/></visual>
    <collision><geometry><capsule/></geometry></collision>
  </link>
  <link name="finger"/><link name="tool"/><link name="tag_12"><visual><origin xyz="0 0 0.001"/>
    <geometry><box size="0.05 0.05 0.002"/></geometry><material name="x"/></visual></link>
  <joint name="grip" type="prismatic"><origin xyz="0 0 0.3"/><parent link="arm"/><child link="finger"/>
    <axis xyz="0 3 0"/><limit lower="0" upper="0.04" effort="1" velocity="1"/>
    <mimic joint="turn" multiplier="0.5"/><safety_controller k_velocity="1"/></joint>
  <joint name="turn" type="continuous"><origin xyz="0 0 0.1" rpy="0 0 1"/><parent link="base"/>
    <child link="arm"/><calibration rising="0"/><dynamics damping="0.1"/></joint>
  <joint name="fix" type="fixed"><parent link="world"/><child link="base"/></joint>
  <joint name="mount" type="fixed"><origin xyz="1 2 3"/><parent link="finger"/><child link="tag_12"/></joint>
  <joint name="tool0" type="fixed"><parent link="finger"/><child link="tool"/></joint>
  <transmission name="t"><type>transmission_interface/SimpleTransmission</type></transmission>
  <gazebo reference="arm"><kp>1e6</kp></gazebo>
</robot>)";

TEST(UrdfReads, AnUntidyNominalRobot) {
  const KinematicTree tree = parse_urdf(kUntidy, "untidy.urdf");
  EXPECT_EQ(tree.name, "untidy");
  EXPECT_EQ(tree.links.front().name, "world");
  // The children stand behind their parents although the file has it the other way round.
  ASSERT_EQ(tree.joints.size(), 4U);
  EXPECT_EQ(tree.joints[0].name, "fix");
  const Joint& turn = tree.joints[tree.joint("turn")->index()];
  EXPECT_EQ(turn.type, JointType::kRevolute);
  EXPECT_FALSE(turn.limits);
  EXPECT_EQ(turn.axis, Eigen::Vector3d::UnitX()) << "URDF's default axis";
  const Joint& grip = tree.joints[tree.joint("grip")->index()];
  EXPECT_EQ(grip.type, JointType::kPrismatic);
  EXPECT_EQ(grip.axis, Eigen::Vector3d::UnitY()) << "made a unit vector";
  EXPECT_EQ(grip.limits, (JointLimits{0.0, 0.04}));
  ASSERT_EQ(tree.markers.size(), 1U);
  EXPECT_EQ(tree.markers[0].id, TagId{12});
  EXPECT_EQ(tree.links[tree.markers[0].link.index()].name, "finger");
  EXPECT_EQ(tree.markers[0].size_m, 0.05);
  EXPECT_EQ(tree.markers[0].T_link_marker.translation, Eigen::Vector3d(1, 2, 3));
}

TEST(UrdfReads, ALinkIsAMarkerOnlyWhenFixedLastAndNumbered) {
  const auto count = [](std::string_view name, std::string_view type) {
    return parse_urdf(
               fmt::format(
                   "<robot name='r'><link name='a'/><link name='{0}'/><joint name='j' type='{1}'>"
                   "<parent link='a'/><child link='{0}'/></joint></robot>",
                   name, type),
               "memory")
        .markers.size();
  };
  EXPECT_EQ(count("tag_0", "fixed"), 1U);
  EXPECT_EQ(count("tag_7", "continuous"), 0U);
  EXPECT_EQ(count("tag_07", "fixed"), 0U);
  EXPECT_EQ(count("tag_", "fixed"), 0U);
  EXPECT_EQ(count("tag_-1", "fixed"), 0U);
  EXPECT_EQ(count("tag_x", "fixed"), 0U);
}

TEST(UrdfReads, TheRobotsOfTheSyntheticRecordings) {
  const auto file = shared_data("synthetic/scara4_none/truth.urdf");
  if (!file) GTEST_SKIP() << "shared recordings are not on this machine";
  const KinematicTree tree = read_urdf(*file);
  ASSERT_EQ(tree.joints.size(), 4U);
  EXPECT_EQ(tree.joints[2].type, JointType::kPrismatic);
  EXPECT_EQ(tree.links[0].name, "base");
}

}  // namespace
}  // namespace kinescope
