// SPDX-License-Identifier: Apache-2.0
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/kinematics/model/random_tree.h"
#include "tests/truth/random_dynamics.h"

namespace kinescope {
namespace {

// Numbers are written so that they read back exactly; the central form costs some rounding.
constexpr double kReadsBack = 1e-12;

std::string robot_with_inertial(std::string_view inertial, std::string_view in_joint = "") {
  return fmt::format(
      "<robot name=\"r\">\n<link name=\"a\"/>\n<link name=\"b\">\n{}\n</link>\n"
      "<joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child "
      "link=\"b\"/>\n{}\n</joint>\n"
      "</robot>\n",
      inertial, in_joint);
}

std::string dynamic_refusal(const std::string& text) {
  try {
    static_cast<void>(parse_dynamic_urdf(text, "robot.urdf"));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    return error.what();
  }
  return "accepted";
}

constexpr std::string_view kInertia =
    R"(<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/>)";

TEST(DynamicUrdf, ReadsInertialsInTheLinksFrame) {
  const DynamicModel model = parse_dynamic_urdf(
      robot_with_inertial(fmt::format(
          R"(<inertial><origin xyz="0 0 0.5" rpy="0 0 {}"/><mass value="2"/>{}</inertial>)",
          0.5 * std::numbers::pi, kInertia)),
      "robot.urdf");
  const CentralInertia link = to_central(model.links[1]);
  EXPECT_NEAR(link.mass_kg, 2.0, kReadsBack);
  EXPECT_LT((link.centre_m - Eigen::Vector3d(0, 0, 0.5)).norm(), kReadsBack);
  // A quarter turn about z exchanges x and y.
  EXPECT_LT((link.inertia_kgm2.diagonal() - Eigen::Vector3d(0.2, 0.1, 0.25)).norm(), kReadsBack);
  EXPECT_TRUE(model.links[0].vector().isZero());
}

TEST(DynamicUrdf, WrittenAndReadBackItIsTheSameRobot) {
  Rng rng = Rng::from_name("DynamicUrdf.WrittenAndReadBack");
  for (int k = 0; k < 20; ++k) {
    const DynamicModel model = random_masses(random_tree(rng, 1 + rng.index(9), 2), {}, rng);
    const DynamicModel back = parse_dynamic_urdf(write_urdf(model), "written");
    ASSERT_EQ(back.links.size(), model.links.size());
    for (std::size_t l = 0; l < model.links.size(); ++l) {
      EXPECT_LT((back.links[l].vector() - model.links[l].vector()).norm(),
                kReadsBack * model.links[l].vector().norm());
    }
    EXPECT_EQ(back.joints, model.joints);
    EXPECT_EQ(write_urdf(model), write_urdf(model));
  }
}

TEST(DynamicUrdf, WithoutMassesItIsTheKinematicOne) {
  Rng rng = Rng::from_name("DynamicUrdf.WithoutMasses");
  const KinematicTree tree = random_tree(rng, 6, 2);
  EXPECT_EQ(write_urdf(without_masses(tree), LimitSource::kRecording), write_urdf(tree));
  EXPECT_EQ(write_urdf(tree).find("inertial"), std::string::npos);
  EXPECT_EQ(write_urdf(tree).find("dynamics"), std::string::npos);
}

TEST(DynamicUrdf, AMarkersMassBelongsToItsLink) {
  const std::string text = R"(<robot name="r"><link name="a"/><link name="b"/>
    <link name="tag_3"><inertial><mass value="0.5"/>
      <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
    <joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>
    <joint name="t" type="fixed"><origin xyz="0 0 0.4"/><parent link="b"/><child link="tag_3"/></joint>
    </robot>)";
  const DynamicModel model = parse_dynamic_urdf(text, "robot.urdf");
  ASSERT_EQ(model.links.size(), 2U);
  EXPECT_DOUBLE_EQ(model.links[1].mass_kg, 0.5);
  EXPECT_DOUBLE_EQ(model.links[1].first_moment_kgm.z(), 0.2);
}

TEST(DynamicUrdf, RefusesWithLineAndRemedy) {
  EXPECT_EQ(dynamic_refusal(robot_with_inertial("")), "accepted");
  EXPECT_EQ(dynamic_refusal(robot_with_inertial(fmt::format("<inertial>{}</inertial>", kInertia))),
            "robot.urdf:4: link 'b': <inertial> has no <mass value=\"..\"> (add it, or leave the "
            "whole element out)");
  EXPECT_EQ(dynamic_refusal(robot_with_inertial(
                fmt::format("<inertial><mass value=\"-1\"/>{}</inertial>", kInertia))),
            "robot.urdf:4: link 'b': the mass is -1 kg (a mass is not negative)");
  EXPECT_TRUE(dynamic_refusal(robot_with_inertial(
                                  R"(<inertial><mass value="1"/><inertia ixx="0.1"/></inertial>)"))
                  .starts_with("robot.urdf:4: link 'b': <inertial> has no <inertia "));
  EXPECT_TRUE(dynamic_refusal(robot_with_inertial(fmt::format(
                                  "<inertial><mass value=\"nan\"/>{}</inertial>", kInertia)))
                  .starts_with("robot.urdf:4: link 'b': <mass value=\"nan\"> holds 'nan'"));
  EXPECT_TRUE(dynamic_refusal(robot_with_inertial("", R"(<dynamics damping="-0.1"/>)"))
                  .starts_with("robot.urdf:7: joint 'j': damping is -0.1"));
  EXPECT_TRUE(dynamic_refusal(robot_with_inertial("", R"(<dynamics friction="x"/>)"))
                  .starts_with("robot.urdf:7: joint 'j': <dynamics friction=\"x\"> holds 'x'"));
  EXPECT_TRUE(dynamic_refusal(robot_with_inertial("", R"(<mimic joint="k"/>)"))
                  .starts_with("robot.urdf:7: joint 'j' follows another joint (mimic)"));
}

TEST(DynamicUrdf, RefusesSizesThatNoRobotHas) {
  EXPECT_EQ(dynamic_refusal(robot_with_inertial(
                fmt::format("<inertial><mass value=\"1e300\"/>{}</inertial>", kInertia))),
            "robot.urdf:4: link 'b': the mass is 1e+300, more than 1e+06 (URDF is in kg, m and s: "
            "correct it)");
  EXPECT_TRUE(dynamic_refusal(robot_with_inertial(R"(<inertial><mass value="1"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="2e6"/></inertial>)"))
                  .starts_with("robot.urdf:4: link 'b': izz is 2e+06"));
  EXPECT_TRUE(dynamic_refusal(robot_with_inertial(fmt::format(
                                  R"(<inertial><origin xyz="0 0 1e200"/><mass value="1"/>{})"
                                  "</inertial>",
                                  kInertia)))
                  .starts_with("robot.urdf:4: link 'b': a coordinate of the centre of mass"));
  EXPECT_TRUE(dynamic_refusal(robot_with_inertial("", R"(<dynamics armature="1e7"/>)"))
                  .starts_with("robot.urdf:7: joint 'j': armature is 1e+07"));
}

TEST(DynamicUrdf, RefusesToWriteWhatUrdfCannotSay) {
  Rng rng = Rng::from_name("DynamicUrdf.RefusesToWrite");
  DynamicModel model = without_masses(random_tree(rng, 2, 0));
  model.links[1].first_moment_kgm.x() = 0.1;
  EXPECT_THROW(static_cast<void>(write_urdf(model)), Error);
}

}  // namespace
}  // namespace kinescope
