// SPDX-License-Identifier: Apache-2.0
#include <regex>

#include <gtest/gtest.h>

#include "kinematics/urdf/urdf.h"
#include "tests/kinematics/model/random_tree.h"
#include "tests/kinematics/urdf/tree_difference.h"

namespace kinescope {
namespace {

TEST(UrdfRoundTrip, ThousandPosturesOnRandomTrees) {
  Rng rng = Rng::from_name("UrdfRoundTrip.ThousandPosturesOnRandomTrees");
  for (int robot = 0; robot < 50; ++robot) {
    const KinematicTree tree = random_tree(rng, 1 + rng.index(10), rng.index(6));
    const KinematicTree back = parse_urdf(write_urdf(tree), "memory");
    ASSERT_EQ(back.joints.size(), tree.joints.size());
    ASSERT_EQ(back.markers.size(), tree.markers.size());
    for (int posture = 0; posture < 20; ++posture) {
      EXPECT_LT(worst_difference(tree, back, random_values(rng, tree)), kExact)
          << "robot " << robot;
    }
  }
}

TEST(UrdfRoundTrip, KeepsEverythingElse) {
  Rng rng = Rng::from_name("UrdfRoundTrip.KeepsEverythingElse");
  for (int robot = 0; robot < 20; ++robot) {
    const KinematicTree tree = random_tree(rng, 8, 5);
    const KinematicTree back = parse_urdf(write_urdf(tree), "memory");
    EXPECT_EQ(back.name, tree.name);
    for (std::size_t j = 0; j < tree.joints.size(); ++j) {
      EXPECT_EQ(back.joints[j].name, tree.joints[j].name);
      EXPECT_EQ(back.joints[j].type, tree.joints[j].type);
      EXPECT_EQ(back.joints[j].parent, tree.joints[j].parent);
      EXPECT_EQ(back.joints[j].child, tree.joints[j].child);
      EXPECT_EQ(back.joints[j].limits, tree.joints[j].limits);
    }
    for (std::size_t m = 0; m < tree.markers.size(); ++m) {
      EXPECT_EQ(back.markers[m].id, tree.markers[m].id);
      EXPECT_EQ(back.markers[m].link, tree.markers[m].link);
      EXPECT_EQ(back.markers[m].size_m, tree.markers[m].size_m);
    }
  }
}

// Two fingers of a gripper: the second one closes as far as the first, the other way.
TEST(UrdfRoundTrip, JointsOfOneChannelFollowTheFirst) {
  KinematicTree tree;
  tree.links = {{"hand"}, {"left"}, {"right"}};
  for (int j = 0; j < 2; ++j) {
    Joint finger;
    finger.name = j == 0 ? "grip" : "grip_2";
    finger.channel = "grip";
    finger.type = JointType::kPrismatic;
    finger.parent = LinkId{0};
    finger.child = LinkId{j + 1};
    finger.axis = Eigen::Vector3d::UnitX();
    finger.scale = j == 0 ? 1e-3 : -1e-3;
    finger.offset = j == 0 ? 0.02 : -0.03;
    tree.joints.push_back(finger);
  }
  const std::string text = write_urdf(tree);
  EXPECT_EQ(write_urdf(tree), text);
  const KinematicTree back = parse_urdf(text, "gripper.urdf");
  ASSERT_EQ(back.joints.size(), 2U);
  EXPECT_EQ(back.joints[1].channel, "grip");
  for (const double reading : {-5.0, 0.0, 12.0}) {
    const double first = tree.joints[0].scale * reading + tree.joints[0].offset;
    const double second = tree.joints[1].scale * reading + tree.joints[1].offset;
    EXPECT_NEAR(back.joints[1].scale * first + back.joints[1].offset, second, 1e-12);
  }
}

TEST(UrdfRoundTrip, SecondWritingIsTheSameText) {
  Rng rng = Rng::from_name("UrdfRoundTrip.SecondWriting");
  const KinematicTree tree = random_tree(rng, 6, 3);
  EXPECT_EQ(write_urdf(tree), write_urdf(tree));
}

TEST(UrdfWrite, NamesAreMadeFitForOthers) {
  KinematicTree tree;
  tree.name = "my \"robot\" <1>";
  tree.links = {{"base"}, {"Arm 1"}, {"Arm_1"}, {""}, {"tag_3"}};
  for (int j = 0; j < 4; ++j) {
    Joint joint;
    joint.name = std::vector<std::string>{"q&1", "q<1", "/arm/wrist",
                                          "\xCE\xB8"}[static_cast<std::size_t>(j)];
    joint.type = JointType::kRevolute;
    joint.parent = LinkId{0};
    joint.child = LinkId{j + 1};
    tree.joints.push_back(joint);
  }
  tree.markers = {{.id = TagId{3}, .link = LinkId{1}, .T_link_marker = {}, .size_m = 0.05}};
  const KinematicTree back = parse_urdf(write_urdf(tree), "memory");
  EXPECT_EQ(back.name, "my__robot___1_");
  EXPECT_EQ(back.links[1].name, "Arm_1");
  EXPECT_EQ(back.links[2].name, "Arm_1_2");
  EXPECT_EQ(back.links[3].name, "link");
  EXPECT_EQ(back.links[4].name, "tag_3_2");
  EXPECT_EQ(back.joints[0].name, "q_1");
  EXPECT_EQ(back.joints[1].name, "q_1_2");
  EXPECT_EQ(back.joints[2].name, "arm/wrist");
  EXPECT_EQ(back.joints[3].name, "_");
  EXPECT_EQ(back.markers[0].link, LinkId{1});
}

TEST(UrdfWrite, TheCommentSaysWhereLimitsComeFrom) {
  Rng rng = Rng::from_name("UrdfWrite.TheCommentSaysWhereLimitsComeFrom");
  KinematicTree tree = random_tree(rng, 2, 0);
  for (Joint& joint : tree.joints) joint.type = JointType::kRevolute;
  const std::string unknown = write_urdf(tree);
  EXPECT_NE(unknown.find("the range that the recording shows"), std::string::npos) << unknown;
  EXPECT_NE(unknown.find("not measured and bind nowhere"), std::string::npos) << unknown;
  EXPECT_FALSE(parse_urdf(unknown, "memory").joints[0].effort);

  tree.joints[0].effort = 87.0;
  tree.joints[0].velocity = 2.175;
  const std::string partly = write_urdf(tree, LimitSource::kRobotFile);
  EXPECT_NE(partly.find("those of the robot's own file"), std::string::npos) << partly;
  EXPECT_NE(partly.find("stands where neither is known"), std::string::npos) << partly;
  const KinematicTree back = parse_urdf(partly, "memory");
  EXPECT_EQ(back.joints[0].effort, 87.0);
  EXPECT_EQ(back.joints[0].velocity, 2.175);
  EXPECT_FALSE(back.joints[1].effort);
}

TEST(UrdfWrite, RefusesWhatIsNoTree) {
  KinematicTree tree;
  EXPECT_THROW(static_cast<void>(write_urdf(tree)), std::logic_error);
  tree.links = {{"base"}};
  tree.markers = {{.id = TagId{1}, .link = LinkId{0}, .T_link_marker = {}, .size_m = 0.1}};
  tree.markers.push_back(tree.markers.front());
  EXPECT_THROW(static_cast<void>(write_urdf(tree)), std::logic_error) << "one marker twice";
  tree.markers.pop_back();
  tree.markers[0].T_link_marker.translation.x() = std::nan("");
  EXPECT_THROW(static_cast<void>(write_urdf(tree)), std::logic_error) << "NaN";
}

TEST(UrdfWrite, FixedAxisAnglesInTheOrderOfUrdf) {
  // Rz(yaw) Ry(pitch) Rx(roll): with yaw and roll of 90 degrees x goes to y, y to z, z to x.
  KinematicTree tree;
  tree.links = {{"base"}, {"tip"}};
  Joint joint;
  joint.name = "j";
  joint.parent = LinkId{0};
  joint.child = LinkId{1};
  Eigen::Matrix3d R;
  R << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  joint.T_parent_joint.rotation = Eigen::Quaterniond(R);
  tree.joints.push_back(joint);
  std::smatch match;
  const std::string text = write_urdf(tree);
  ASSERT_TRUE(std::regex_search(
      text, match, std::regex("<joint[^]*rpy=\"([-0-9.e]+) ([-0-9.e]+) ([-0-9.e]+)\"")));
  EXPECT_NEAR(std::stod(match[1]), 0.5 * std::numbers::pi, 1e-15);
  EXPECT_NEAR(std::stod(match[2]), 0.0, 1e-15);
  EXPECT_NEAR(std::stod(match[3]), 0.5 * std::numbers::pi, 1e-15);
}

}  // namespace
}  // namespace kinescope
