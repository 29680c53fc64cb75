// SPDX-License-Identifier: Apache-2.0
#include "app/explain/nominal_channels.h"

#include <algorithm>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "app/commands/inspection.h"
#include "kinematics/urdf/urdf.h"
#include "tests/app/io/recording_folder.h"

namespace kinescope {
namespace {

constexpr std::string_view kLimit = R"(<limit lower="0" upper="1" effort="1" velocity="1"/>)";

/// Arm of shoulder and elbow; a finger on its end, whose other side follows the elbow.
std::string gripper_urdf() {
  std::string text = "<robot name='r'><link name='base'/>";
  for (const char* link : {"upper", "lower", "left", "right"}) {
    text += std::string("<link name='") + link + "'/>";
  }
  const auto joint = [&](const char* name, const char* type, const char* from, const char* to,
                         const char* more) {
    text += fmt::format(
        "<joint name='{}' type='{}'><parent link='{}'/><child link='{}'/><axis xyz='0 0 1'/>{}{}"
        "</joint>",
        name, type, from, to, kLimit, more);
  };
  joint("shoulder", "revolute", "base", "upper", "");
  joint("elbow", "revolute", "upper", "lower", "");
  joint("finger", "prismatic", "lower", "left", "");
  joint("other", "prismatic", "lower", "right",
        "<mimic joint='elbow' multiplier='-0.5' offset='0.1'/>");
  return text + "</robot>";
}

Recording with_columns(const std::vector<std::string>& columns) {
  Recording recording;
  recording.folder = "lab";
  recording.nominal = parse_urdf(gripper_urdf(), "gripper.urdf");
  recording.log.source = "joints.csv";
  recording.log.channels = columns;
  recording.log.times_s = {0.0, 1.0};
  recording.log.values.resize(2, static_cast<Eigen::Index>(columns.size()));
  recording.log.values.row(0).setZero();
  recording.log.values.row(1).setOnes();
  return recording;
}

std::string refusal_of_channels(const Recording& recording) {
  try {
    static_cast<void>(match_channels(recording));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    return error.what();
  }
  return "accepted";
}

TEST(NominalChannels, AFingerThatIsNotLoggedIsHeldAndAFollowerFollows) {
  const NominalChannels matched = match_channels(with_columns({"elbow", "shoulder"}));
  ASSERT_EQ(matched.tree.joints.size(), 4U);
  EXPECT_EQ(matched.tree.joints[1].channel, "elbow");
  EXPECT_EQ(matched.tree.joints[2].channel, "");
  EXPECT_EQ(matched.tree.joints[3].channel, "elbow");
  EXPECT_EQ(matched.tree.joints[3].scale, -0.5);
  EXPECT_EQ(matched.tree.joints[3].offset, 0.1);
  ASSERT_EQ(matched.warnings.size(), 1U);
  EXPECT_NE(matched.warnings[0].find("no column for finger of the nominal robot: held at 0"),
            std::string::npos)
      << matched.warnings[0];
}

TEST(NominalChannels, AColumnOfItsOwnComesBeforeFollowing) {
  const NominalChannels matched =
      match_channels(with_columns({"shoulder", "elbow", "finger", "other"}));
  EXPECT_EQ(matched.tree.joints[3].channel, "other");
  EXPECT_EQ(matched.tree.joints[3].scale, 1.0);
  EXPECT_EQ(matched.tree.joints[3].offset, 0.0);
  EXPECT_TRUE(matched.warnings.empty());
}

TEST(NominalChannels, AMisspeltColumnIsNamedWithItsJoint) {
  const std::string misspelt = refusal_of_channels(with_columns({"shoulder", "elbow", "fnger"}));
  EXPECT_NE(misspelt.find("'finger'"), std::string::npos) << misspelt;
  EXPECT_NE(misspelt.find("the column 'fnger'"), std::string::npos) << misspelt;
}

TEST(NominalChannels, AJointBeforeLoggedOnesMustBeLogged) {
  const std::string missing = refusal_of_channels(with_columns({"elbow", "finger"}));
  EXPECT_NE(missing.find("'shoulder'"), std::string::npos) << missing;
  EXPECT_NE(missing.find("known: elbow, finger"), std::string::npos) << missing;
}

TEST(NominalChannels, WithoutALogItsFileIsNamed) {
  Recording recording = with_columns({});
  recording.log = {};
  EXPECT_NE(refusal_of_channels(recording).find("lab/joints.csv"), std::string::npos)
      << refusal_of_channels(recording);
}

TEST(NominalChannels, FollowersHaveNoPlaceInTheOrder) {
  const NominalChannels matched = match_channels(with_columns({"a", "b", "c"}));
  EXPECT_EQ(matched.tree.joints[2].channel, "c");
  EXPECT_EQ(matched.tree.joints[3].channel, "b");
  EXPECT_NE(matched.warnings.at(0).find("taken in order"), std::string::npos);
}

/// Two joints about parallel axes in a chain, driven by the columns in the order given.
Structure two_turns(const std::vector<int>& channels) {
  Structure structure;
  structure.status = StructureStatus::kDetermined;
  structure.links.resize(channels.size() + 1);
  for (std::size_t k = 0; k < channels.size(); ++k) {
    StructureJoint joint;
    joint.parent_link = static_cast<int>(k);
    joint.child_link = static_cast<int>(k) + 1;
    joint.channel = ChannelTerm{.channel = channels[k]};
    structure.joints.push_back(joint);
  }
  return structure;
}

TEST(NominalChannels, WithoutNamesTheMarkersSayWhichColumnDrivesWhat) {
  Recording recording = with_columns({"a", "b"});
  KinematicTree& arm = *recording.nominal;
  arm.joints.resize(2);
  arm.links.resize(3);
  const NominalChannels ordered = match_channels(recording);
  ASSERT_TRUE(ordered.in_order);
  const NominalChannels moved = by_motion(ordered, two_turns({1, 0}), recording.log);
  EXPECT_EQ(moved.tree.joints[0].channel, "b");
  EXPECT_EQ(moved.tree.joints[1].channel, "a");
  ASSERT_EQ(moved.warnings.size(), 1U);
  EXPECT_NE(moved.warnings[0].find("b drives shoulder, a drives elbow"), std::string::npos)
      << moved.warnings[0];
  // As it was where the structure is another one, or no answer.
  Structure other = two_turns({1, 0});
  other.joints[1].type = JointType::kPrismatic;
  EXPECT_EQ(by_motion(ordered, other, recording.log).tree.joints[0].channel, "a");
  other = two_turns({1, 0});
  other.status = StructureStatus::kAmbiguous;
  EXPECT_EQ(by_motion(ordered, other, recording.log).tree.joints[0].channel, "a");
  EXPECT_EQ(by_motion(ordered, two_turns({1}), recording.log).tree.joints[0].channel, "a");
  EXPECT_EQ(by_motion(ordered, two_turns({1, 1}), recording.log).tree.joints[0].channel, "a");
}

// A column of a gripper, or of a motor that drives nothing, beside those of the joints.
TEST(NominalChannels, OfMoreColumnsThanJointsTheMarkersSayWhichDriveThem) {
  Recording recording = with_columns({"a", "idle", "b"});
  KinematicTree& arm = *recording.nominal;
  arm.joints.resize(2);
  arm.links.resize(3);
  const NominalChannels ordered = match_channels(recording);
  ASSERT_TRUE(ordered.of_more);
  EXPECT_THROW(require_columns_known(ordered, recording.log), Error);
  const NominalChannels moved = by_motion(ordered, two_turns({2, 0}), recording.log);
  EXPECT_NO_THROW(require_columns_known(moved, recording.log));
  EXPECT_EQ(moved.tree.joints[0].channel, "b");
  EXPECT_EQ(moved.tree.joints[1].channel, "a");
  EXPECT_THROW(
      require_columns_known(by_motion(ordered, two_turns({2}), recording.log), recording.log),
      Error);
}

TEST(NominalChannels, InspectSaysTheSame) {
  const RecordingFolder folder;
  folder.write("poses.csv", "t,body,x,y,z,qx,qy,qz,qw\n0,1,0,0,1,0,0,0,1\n1,1,0,0,1,0,0,0,1\n")
      .write("joints.csv", "t,shoulder,elbow,fnger\n0,0,0,0\n1,1,1,1\n")
      .write("gripper.urdf", gripper_urdf());
  RecordingPaths paths = folder.paths();
  paths.nominal = folder.path() / "gripper.urdf";
  const Inspection inspection = inspect_recording(paths);
  EXPECT_FALSE(inspection.ready());
  EXPECT_TRUE(std::ranges::any_of(inspection.findings, [](const Finding& finding) {
    return finding.problem && finding.text.find("'fnger'") != std::string::npos;
  }));
}

}  // namespace
}  // namespace kinescope
