// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/verdict.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace kinescope::structure_search
