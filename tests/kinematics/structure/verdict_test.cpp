// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/verdict.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/structure/natural_units.h"

namespace kinescope::structure_search {
namespace {

Attachment driven_by_the_first(JointType type, double cost) {
  ChainJoint joint;
  joint.type = type;
  joint.terms = {{.channel = 0, .scale = 1.0}};
  Attachment attachment;
  attachment.fit.model.joints = {joint};
  attachment.fit.correlation = 1.0;
  attachment.data_cost = cost;
  return attachment;
}

// What is known of the recording stays known, and each has the other for a rival.
TEST(Verdict, ARivalTakesTheStructuresPlace) {
  JointLog log;
  log.channels = {"q"};
  Structure structure;
  structure.links = {{{TagId{1}}, {Pose{}}}, {{TagId{2}}, {Pose{}}}};
  StructureJoint joint;
  joint.child_link = 1;
  joint.channel = ChannelTerm{0, 1.0, 0.0};
  structure.joints = {joint};
  structure.time_offset_sigma_s = 0.01;
  structure.doubts = {{"of the recording", "", {}}, {"of the model", "", {}, true}};
  structure.doubts.push_back(rival_doubt("tag 2 slides"));
  Structure other = structure;
  other.joints.front().type = JointType::kPrismatic;
  other.doubts.clear();
  structure.rivals = {{"tag 2 slides", "tag 2 turns", other}};
  const Structure taken = with_rival(structure, 0, log);
  EXPECT_EQ(taken.joints.front().type, JointType::kPrismatic);
  EXPECT_EQ(taken.time_offset_sigma_s, 0.01);
  ASSERT_EQ(taken.doubts.size(), 1U);
  EXPECT_EQ(taken.doubts.front().what, "of the recording");
  ASSERT_EQ(taken.rivals.size(), 1U);
  EXPECT_EQ(taken.rivals.front().words, "tag 2 turns");
  EXPECT_EQ(taken.rivals.front().structure.joints.front().type, JointType::kRevolute);
  const Structure clear = with_rivals_judged(taken, {20.0});
  EXPECT_EQ(clear.status, StructureStatus::kDetermined);
  EXPECT_EQ(clear.runner_up, "tag 2 turns");
  const Structure open = with_rivals_judged(taken, {1.0});
  EXPECT_EQ(open.status, StructureStatus::kAmbiguous);
  EXPECT_EQ(open.doubts.size(), 2U);
}

// One marker turned by the only channel, or slid by it: whichever, no two channels are confused.
TEST(Verdict, AChannelDoesNotMoveTogetherWithItself) {
  GrownTree tree;
  tree.links.resize(2);
  tree.links[1].parent = 0;
  tree.links[1].founder = 0;
  tree.links[1].attachment = driven_by_the_first(JointType::kRevolute, 0.0);
  GrownBody body;
  body.link = 1;
  body.attachment = tree.links[1].attachment;
  body.alternatives = {driven_by_the_first(JointType::kPrismatic, 1.0)};
  body.everywhere_cost = 1e3;
  tree.bodies = {body};
  Series series;
  series.times_s = {0.0, 1.0};
  series.bodies.resize(1);
  series.bodies[0].id = TagId{4};
  Readings readings;
  readings.value.resize(2, 1);
  readings.value << -1.0, 1.0;
  readings.mean = {0.0};
  readings.rms = {1.0};
  readings.log_channel = {0};
  JointLog log;
  log.channels = {"q"};
  const Verdict verdict = judge(tree, series, readings, log, {});
  EXPECT_EQ(verdict.status, StructureStatus::kAmbiguous);
  ASSERT_EQ(verdict.doubts.size(), 1U);
  EXPECT_TRUE(verdict.doubts[0].what.starts_with("it could also be: tag 4"))
      << verdict.doubts[0].what;
}

// Two hinges in series whose channels are multiples: `a` counts 1.5 times as far as `b`.
class ProportionalChannels : public testing::Test {
 protected:
  ProportionalChannels() {
    tree.links.resize(3);
    tree.bodies.resize(2);
    for (int l = 1; l <= 2; ++l) {
      GrownLink& link = tree.link(l);
      link.parent = l - 1;
      link.founder = l - 1;
      link.attachment = driven_by_the_first(JointType::kRevolute, 0.0);
      link.attachment.fit.scale_sigma = {1e-4};
    }
    readings.value.resize(2, 2);
    readings.value << -1.0, -1.0, 1.0, 1.0;
    readings.mean = {0.0, 0.0};
    readings.rms = {0.9, 0.6};
    readings.log_channel = {0, 1};
    series.times_s = {0.0, 1.0};
    series.bodies.resize(2);
    log.channels = {"a", "b"};
    term(1) = {1, 0.9};
    term(2) = {0, -0.6};
  }

  ChainTerm& term(int l) { return tree.link(l).attachment.fit.model.joints.front().terms.front(); }

  Verdict verdict() {
    for (std::size_t b = 0; b < 2; ++b) {
      tree.bodies[b].link = static_cast<int>(b) + 1;
      tree.bodies[b].attachment = tree.link(static_cast<int>(b) + 1).attachment;
      tree.bodies[b].everywhere_cost = 1e3;
    }
    return judge(tree, series, readings, log, {});
  }

  GrownTree tree;
  Readings readings;
  Series series;
  JointLog log;
};

TEST_F(ProportionalChannels, UsualUnitsDecide) {
  ASSERT_EQ(possible_exchanges(tree, readings).size(), 1U);
  tree = with_likely_exchanges(tree, readings);
  EXPECT_EQ(term(1).channel, 0);
  EXPECT_EQ(term(2).channel, 1);
  EXPECT_DOUBLE_EQ(term(2).scale, -0.6);
  EXPECT_GT(possible_exchanges(tree, readings).front().loss, 9.2) << "the answer is clear";

  // Clear by the units, which is no more than a custom: the motion says nothing.
  const Verdict judged = verdict();
  EXPECT_EQ(judged.status, StructureStatus::kAmbiguous);
  EXPECT_NEAR(judged.probability, 0.95, 0.01);
  ASSERT_FALSE(judged.doubts.empty());
  EXPECT_EQ(judged.doubts.front().names, (std::vector<std::string>{"a", "b"}));
  term(1).scale = 0.9 * 1.3;
  term(2).scale = 0.6 * 1.1;
  EXPECT_LT(std::abs(possible_exchanges(tree, readings).front().loss), 9.2)
      << "neither way is in usual units";
}

TEST_F(ProportionalChannels, DeclaredUnitsSettleIt) {
  readings.units = {ChannelUnit::kRadian, ChannelUnit::kRadian};
  tree = with_likely_exchanges(tree, readings);
  EXPECT_EQ(term(1).channel, 0);
  EXPECT_EQ(term(2).channel, 1);
  const Verdict judged = verdict();
  EXPECT_EQ(judged.status, StructureStatus::kDetermined);
  EXPECT_GT(judged.probability, 0.999);
  EXPECT_TRUE(judged.doubts.empty());
}

TEST_F(ProportionalChannels, TicksSettleNothing) {
  readings.units = {ChannelUnit::kTicks, ChannelUnit::kTicks};
  EXPECT_LT(std::abs(possible_exchanges(tree, readings).front().loss), 1.0);
}

}  // namespace
}  // namespace kinescope::structure_search
