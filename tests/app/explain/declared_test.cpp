// SPDX-License-Identifier: Apache-2.0
#include "app/explain/declared.h"

#include <gtest/gtest.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

/// Tag 1 rests, tag 2 slides with 'lift', tag 3 moves freely.
Structure lift(double scale, double scale_sigma = 1e-4) {
  Structure structure;
  structure.status = StructureStatus::kDetermined;
  structure.links.resize(2);
  structure.links[0].markers = {TagId{1}};
  structure.links[1].markers = {TagId{2}};
  structure.free_markers = {TagId{3}};
  StructureJoint joint;
  joint.type = JointType::kPrismatic;
  joint.child_link = 1;
  joint.channel = ChannelTerm{.channel = 0, .scale = scale, .scale_sigma = scale_sigma};
  structure.joints = {joint};
  return structure;
}

Recording with(const std::string& unit, const std::vector<TagId>& fixed_tags = {}) {
  Recording recording;
  recording.folder = "lab";
  recording.log.channels = {"lift"};
  if (!unit.empty()) recording.settings.units["lift"] = unit;
  recording.settings.fixed_tags = fixed_tags;
  return recording;
}

template <typename Call>
std::string refusal(Call call, ExitCode code = ExitCode::kUndetermined) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  return "accepted";
}

std::string of_unit(const std::string& unit, const Structure& structure) {
  return refusal([&] { require_declared_units(with(unit), structure); });
}

std::string of_tags(const std::vector<TagId>& tags, ExitCode code = ExitCode::kUndetermined) {
  return refusal([&] { require_fixed_tags(with("", tags), lift(1.0)); }, code);
}

TEST(DeclaredUnits, MustBeWhatTheJointMoves) {
  const std::string line = of_unit("m", lift(1.2));
  EXPECT_NE(line.find("lab/recording.yaml: the channel 'lift', declared in m, moves its joint 1.2 "
                      "times as far"),
            std::string::npos)
      << line;
  EXPECT_NE(line.find("size of the tags"), std::string::npos) << line;
  EXPECT_NE(of_unit("mm", lift(75.0)), "accepted");
  EXPECT_EQ(of_unit("m", lift(1.03)), "accepted") << "an effect of the robot";
  EXPECT_EQ(of_unit("m", lift(1.2, 0.08)), "accepted") << "hardly known";
  EXPECT_EQ(of_unit("ticks", lift(1.2)), "accepted");
  EXPECT_EQ(of_unit("rad", lift(0.002)), "accepted") << "a spindle";
  EXPECT_EQ(of_unit("", lift(1.2)), "accepted");
}

TEST(DeclaredUnits, OfTheOtherKindAreNamed) {
  Structure hinge = lift(0.999);
  hinge.joints[0].type = JointType::kRevolute;
  const std::string line = of_unit("m", hinge);
  EXPECT_NE(line.find("lab/recording.yaml: the channel 'lift', declared in m, turns its joint: its "
                      "readings are in rad (declare it in rad;"),
            std::string::npos)
      << line;
  EXPECT_NE(of_unit("rad", lift(-1.0))
                .find("declared in rad, slides its joint: its readings are "
                      "in m (declare it in m;"),
            std::string::npos);
  hinge.joints[0].channel->scale = 0.9;
  EXPECT_EQ(of_unit("m", hinge), "accepted") << "a lever";
  EXPECT_EQ(of_unit("rad", lift(0.001)), "accepted") << "a spindle";
}

// The reader brings deg to rad; the line has the word of the file.
TEST(DeclaredUnits, AreNamedAsTheyStandInTheFile) {
  Recording recording = with("rad");
  recording.log.unit_factors["lift"] = kRadPerDegree;
  Structure hinge = lift(57.3);
  hinge.joints[0].type = JointType::kRevolute;
  const std::string line = refusal([&] { require_declared_units(recording, hinge); });
  EXPECT_NE(line.find("declared in deg, moves its joint 57.3 times as far"), std::string::npos)
      << line;
}

TEST(DeclaredUnits, AHingesScaleIsNoTagsSize) {
  Structure hinge = lift(1.2);
  hinge.joints[0].type = JointType::kRevolute;
  EXPECT_EQ(of_unit("rad", hinge), "accepted") << "an effect of the robot";
  hinge.joints[0].channel->scale = 0.0175;
  EXPECT_NE(of_unit("rad", hinge).find("check the unit"), std::string::npos);
  Joint joint;
  joint.type = JointType::kRevolute;
  joint.channel = "lift";
  joint.scale = 1.2;
  EXPECT_TRUE(is_declared_in_si(with("deg"), joint));
  EXPECT_FALSE(is_declared_in_si(with("ticks"), joint));
  EXPECT_FALSE(is_declared_in_si(with(""), joint));
}

TEST(DeclaredFixedTags, MustRest) {
  EXPECT_EQ(of_tags({TagId{1}}), "accepted");
  EXPECT_NE(of_tags({TagId{1}, TagId{2}}).find("names 2, but that marker moves with 'lift'"),
            std::string::npos);
  EXPECT_NE(of_tags({TagId{3}}).find("names 3, but that marker moves"), std::string::npos);
  EXPECT_NE(of_tags({TagId{999}}, ExitCode::kBadInput).find("names 999, which is not seen"),
            std::string::npos);
}

TEST(DeclaredFixedTags, MustRestOnANominalRobotToo) {
  KinematicTree tree;
  tree.links = {{"base"}, {"cart"}};
  Joint joint;
  joint.type = JointType::kPrismatic;
  joint.parent = LinkId{0};
  joint.child = LinkId{1};
  tree.joints = {joint};
  tree.markers = {{TagId{1}, LinkId{0}, {}, 0.0}, {TagId{2}, LinkId{1}, {}, 0.0}};
  EXPECT_EQ(refusal([&] { require_fixed_tags(with("", {TagId{1}}), tree); }), "accepted");
  const std::string line = refusal([&] { require_fixed_tags(with("", {TagId{2}}), tree); });
  EXPECT_NE(line.find("moves with the link 'cart'"), std::string::npos) << line;
}

}  // namespace
}  // namespace kinescope
