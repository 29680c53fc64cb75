// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/rerooted.h"

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"
#include "kinematics/log/channel_ranks.h"

namespace kinescope {
namespace {

constexpr double kRounding = 1e-12;  // m, rad, of a dozen poses of about a metre

Pose any_pose(Rng& rng) { return {exp_rotation(rng.normal3(1.0)), rng.normal3(0.3)}; }

// From the camera: 0 - 1 - 2 - 3, and 4 on 1; link 2 has no marker.
Structure branched(Rng& rng) {
  Structure out;
  out.status = StructureStatus::kDetermined;
  out.links.resize(5);
  for (const int l : {1, 3, 4}) {
    out.links[static_cast<std::size_t>(l)].markers = {TagId{10 * l}, TagId{10 * l + 1}};
    out.links[static_cast<std::size_t>(l)].T_reference_marker = {Pose{}, any_pose(rng)};
  }
  out.links[0].markers = {TagId{5}};
  out.links[0].T_reference_marker = {any_pose(rng)};
  const std::vector<std::pair<int, int>> ends{{0, 1}, {1, 2}, {2, 3}, {1, 4}};
  for (std::size_t j = 0; j < ends.size(); ++j) {
    StructureJoint joint;
    joint.type = j % 2 == 0 ? JointType::kRevolute : JointType::kPrismatic;
    joint.parent_link = ends[j].first;
    joint.child_link = ends[j].second;
    joint.T_parent_joint = any_pose(rng);
    joint.T_joint_child = any_pose(rng);
    joint.channel = ChannelTerm{static_cast<int>(j), 0.5 + static_cast<double>(j), 0.01};
    joint.offset = rng.normal(0.2);
    out.joints.push_back(joint);
  }
  return out;
}

JointLog log_of(std::vector<std::string> channels) {
  JointLog out;
  out.channels = std::move(channels);
  return out;
}

Eigen::VectorXd values_of(const KinematicTree& tree, const JointLog& log,
                          const Eigen::VectorXd& readings) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(tree.joints.size()));
  for (std::size_t j = 0; j < tree.joints.size(); ++j)
    out[static_cast<Eigen::Index>(j)] =
        tree.joints[j].scale * readings[log.channel(tree.joints[j].channel).value()] +
        tree.joints[j].offset;
  return out;
}

TEST(Rerooted, SeesEveryMarkerWhereItWas) {
  Rng rng = Rng::from_name("rerooted", 1);
  const JointLog log = log_of({"a", "b", "c", "d"});
  for (int trial = 0; trial < 50; ++trial) {
    const Structure from_camera = branched(rng);
    const int root = 1 + trial % 4;
    const Structure from_base = rerooted(from_camera, root);
    const KinematicTree before = structure_tree(from_camera, log);
    const KinematicTree after = structure_tree(from_base, log);
    check_tree(after);
    const Eigen::VectorXd readings = Eigen::VectorXd::NullaryExpr(4, [&] { return rng.normal(); });
    const auto links = forward_kinematics(before, values_of(before, log, readings));
    const auto moved = forward_kinematics(after, values_of(after, log, readings));
    const auto above =
        std::ranges::find(from_base.joints, from_base.camera_link, &StructureJoint::child_link);
    ASSERT_NE(above, from_base.joints.end());
    const Pose T_base_camera =
        moved[static_cast<std::size_t>(from_base.camera_link)] * above->T_joint_child;
    for (const Marker& marker : before.markers) {
      const Marker& same = *after.marker(marker.id);
      const Pose was = links[marker.link.index()] * marker.T_link_marker;
      const Pose is = T_base_camera.inverse() * moved[same.link.index()] * same.T_link_marker;
      EXPECT_LT(log_pose(was.inverse() * is).norm(), kRounding) << marker.id.value;
    }
    for (const TagId id : from_camera.links[static_cast<std::size_t>(root)].markers)
      EXPECT_EQ(after.marker(id)->link, LinkId{0});
  }
}

TEST(Rerooted, KeepsTheMarkersOfEveryLinkAndTheChannels) {
  Rng rng = Rng::from_name("rerooted", 2);
  const Structure before = branched(rng);
  const Structure after = rerooted(before, 3);
  EXPECT_EQ(after.links[0].markers, before.links[3].markers);
  EXPECT_EQ(after.links[static_cast<std::size_t>(after.camera_link)].markers,
            before.links[0].markers);
  std::vector<int> channels;
  for (const StructureJoint& joint : after.joints) channels.push_back(joint.channel->channel);
  EXPECT_EQ(channels, (std::vector<int>{2, 1, 0, 3}));
}

TEST(Rerooted, TakesTheEndWhoseChannelStandsFirst) {
  Rng rng = Rng::from_name("rerooted", 3);
  const Structure structure = branched(rng);
  EXPECT_EQ(link_at_rest(structure, log_of({"j3", "j2", "j1", "j4"}), {}), 3);
  EXPECT_EQ(link_at_rest(structure, log_of({"j3", "j2", "j4", "j1"}), {}), 4);
  const std::vector<TagId> fixed{TagId{41}};
  EXPECT_EQ(link_at_rest(structure, log_of({"j3", "j2", "j1", "j4"}), fixed), 4);
  const std::vector<TagId> unseen{TagId{99}};
  EXPECT_EQ(link_at_rest(structure, log_of({"j3", "j2", "j1", "j4"}), unseen), std::nullopt);
}

// Camera, three joints, one body.
Structure chain(Rng& rng) {
  Structure out = branched(rng);
  out.joints.pop_back();
  out.links.pop_back();
  for (const std::size_t l : {0U, 1U}) out.links[l] = {};
  return out;
}

TEST(Rerooted, TellsAReversedChainByItsChannels) {
  Rng rng = Rng::from_name("rerooted", 4);
  Structure structure = chain(rng);
  EXPECT_TRUE(shows_one_body(structure));
  EXPECT_TRUE(is_chain_reversed(structure, log_of({"j3", "j2", "j1"})));
  EXPECT_FALSE(is_chain_reversed(structure, log_of({"j1", "j2", "j3"})));
  EXPECT_FALSE(is_chain_reversed(structure, log_of({"j3", "j1", "j2"})));
  EXPECT_TRUE(stands_in_order(structure, log_of({"j1", "j2", "j3"})));
  structure.links[1].markers = {TagId{7}};
  structure.links[1].T_reference_marker = {Pose{}};
  EXPECT_FALSE(shows_one_body(structure));
  EXPECT_FALSE(is_chain_reversed(structure, log_of({"j3", "j2", "j1"})));
}

TEST(ChannelRanks, CountNumbersAndElseTheColumns) {
  EXPECT_EQ(channel_ranks(log_of({"joint10", "joint2", "joint1"})),
            (std::vector<std::size_t>{2, 1, 0}));
  EXPECT_EQ(channel_ranks(log_of({"wrist", "elbow"})), (std::vector<std::size_t>{0, 1}));
  EXPECT_EQ(channel_ranks(log_of({"a2", "b1"})), (std::vector<std::size_t>{0, 1}));
}

}  // namespace
}  // namespace kinescope
