// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/rerooted.h"

#include <algorithm>
#include <vector>

#include "kinematics/core/error.h"
#include "kinematics/log/channel_ranks.h"

namespace kinescope {
namespace {

// A half turn about x points a joint's z the other way: F exp(z q) F^-1 = exp(-z q).
const Pose kTurned{Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0), Eigen::Vector3d::Zero()};

StructureJoint turned_round(StructureJoint joint) {
  const Pose T_parent_joint = joint.T_parent_joint;
  joint.T_parent_joint = joint.T_joint_child.inverse() * kTurned;
  joint.T_joint_child = kTurned.inverse() * T_parent_joint.inverse();
  std::swap(joint.parent_link, joint.child_link);
  return joint;
}

int joint_above(const Structure& structure, int link) {
  const auto found = std::ranges::find(structure.joints, link, &StructureJoint::child_link);
  return found == structure.joints.end() ? -1 : static_cast<int>(found - structure.joints.begin());
}

// Joints from the root outwards, by their places in `joints`.
std::vector<std::size_t> outward(const std::vector<StructureJoint>& joints, int root) {
  std::vector<std::size_t> out;
  std::vector<int> links{root};
  for (std::size_t l = 0; l < links.size(); ++l) {
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (joints[j].parent_link != links[l]) continue;
      out.push_back(j);
      links.push_back(joints[j].child_link);
    }
  }
  return out;
}

bool is_end(const Structure& structure, int link) {
  return link != 0 && std::ranges::find(structure.joints, link, &StructureJoint::parent_link) ==
                          structure.joints.end();
}

// Of a channel in the order of the robot's joints; joints that no channel drives stand last.
std::size_t rank_of(const StructureJoint& joint, const std::vector<std::size_t>& rank) {
  return joint.channel ? rank[static_cast<std::size_t>(joint.channel->channel)] : rank.size();
}

}  // namespace

Structure rerooted(const Structure& structure, int link) {
  KINESCOPE_CHECK(structure.camera_link == 0, "a structure from its camera");
  if (link == 0) return structure;
  std::vector<StructureJoint> joints = structure.joints;
  for (int at = link; at != 0;) {
    const auto above = static_cast<std::size_t>(joint_above(structure, at));
    at = structure.joints[above].parent_link;
    joints[above] = turned_round(joints[above]);
  }
  const std::vector<std::size_t> order = outward(joints, link);
  KINESCOPE_CHECK(order.size() == joints.size(), "a structure is a tree");
  std::vector<int> number(structure.links.size(), 0);
  for (std::size_t k = 0; k < order.size(); ++k)
    number[static_cast<std::size_t>(joints[order[k]].child_link)] = static_cast<int>(k) + 1;
  Structure out = structure;
  out.rivals.clear();
  out.camera_link = number[0];
  for (std::size_t l = 0; l < number.size(); ++l)
    out.links[static_cast<std::size_t>(number[l])] = structure.links[l];
  for (std::size_t k = 0; k < order.size(); ++k) {
    StructureJoint& joint = out.joints[k] = joints[order[k]];
    joint.parent_link = number[static_cast<std::size_t>(joint.parent_link)];
    joint.child_link = number[static_cast<std::size_t>(joint.child_link)];
    if (structure.joint_values.cols() > 0)
      out.joint_values.col(static_cast<Eigen::Index>(k)) =
          structure.joint_values.col(static_cast<Eigen::Index>(order[k]));
  }
  return out;
}

std::optional<int> link_at_rest(const Structure& structure, const JointLog& log,
                                std::span<const TagId> fixed_tags) {
  const auto links = static_cast<int>(structure.links.size());
  for (int l = 0; !fixed_tags.empty() && l < links; ++l) {
    const std::vector<TagId>& markers = structure.links[static_cast<std::size_t>(l)].markers;
    if (std::ranges::find(markers, fixed_tags.front()) != markers.end()) return l;
  }
  if (!fixed_tags.empty()) return std::nullopt;
  const std::vector<std::size_t> rank = channel_ranks(log);
  std::optional<int> out;
  std::size_t first = 0;
  for (int l = 1; l < links; ++l) {
    if (!is_end(structure, l)) continue;
    const auto above = static_cast<std::size_t>(joint_above(structure, l));
    const std::size_t of_last = rank_of(structure.joints[above], rank);
    if (out && of_last >= first) continue;
    out = l;
    first = of_last;
  }
  return out;
}

bool shows_one_body(const Structure& structure) {
  const auto last = std::ranges::find_if(
      structure.links, [](const StructureLink& link) { return !link.markers.empty(); });
  if (last == structure.links.end() || last == structure.links.begin()) return false;
  return std::ranges::count_if(structure.links,
                               [](const StructureLink& link) { return !link.markers.empty(); }) ==
             1 &&
         is_end(structure, static_cast<int>(last - structure.links.begin()));
}

bool stands_in_order(const Structure& structure, const JointLog& log) {
  const std::vector<std::size_t> rank = channel_ranks(log);
  bool any = false;
  for (const StructureJoint& joint : structure.joints) {
    const int above = joint_above(structure, joint.parent_link);
    if (above < 0 || !joint.channel) continue;
    const StructureJoint& before = structure.joints[static_cast<std::size_t>(above)];
    if (!before.channel) continue;
    if (rank_of(joint, rank) <= rank_of(before, rank)) return false;
    any = true;
  }
  return any;
}

bool is_chain_reversed(const Structure& structure, const JointLog& log) {
  constexpr std::size_t kFewest = 3;  // two stand in either order as often
  if (!shows_one_body(structure) || structure.joints.size() < kFewest) return false;
  const std::vector<std::size_t> rank = channel_ranks(log);
  for (std::size_t k = 0; k < structure.joints.size(); ++k) {
    const StructureJoint& joint = structure.joints[k];
    if (!joint.channel) return false;
    if (k == 0) continue;
    const StructureJoint& before = structure.joints[k - 1];
    if (joint.parent_link != before.child_link) return false;
    if (rank_of(joint, rank) >= rank_of(before, rank)) return false;
  }
  return true;
}

}  // namespace kinescope
