// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/structure_check.h"

#include <algorithm>

#include <fmt/format.h>

namespace kinescope {

std::vector<TrueEdge> true_edges(const RandomRobot& robot, const RobotRecording& recording) {
  std::vector<TrueEdge> edges;
  for (std::size_t j = 0; j < robot.tree.joints.size(); ++j) {
    const Joint& joint = robot.tree.joints[j];
    edges.push_back(
        {joint.parent.value, joint.child.value, joint.type, recording.channel_of_joint[j]});
  }
  std::ranges::sort(edges);
  return edges;
}

std::map<TagId, int> link_of_tags(const RandomRobot& robot) {
  std::map<TagId, int> links;
  for (const Marker& m : robot.tree.markers) links[m.id] = m.link.value;
  return links;
}

namespace {

// The edges of the truth, but for the names of links.
bool edges_right(const Structure& found, const RandomRobot& robot,
                 const RobotRecording& recording) {
  const auto links = link_of_tags(robot);
  std::vector<int> true_link(found.links.size(), -1);
  true_link[0] = 0;
  for (std::size_t l = 0; l < found.links.size(); ++l) {
    for (const TagId tag : found.links[l].markers) {
      const int link = links.at(tag);
      if (true_link[l] >= 0 && true_link[l] != link) return false;
      true_link[l] = link;
    }
  }
  // Links without a marker are named by the joint that leads there: its channel tells which one it
  // is.
  std::vector<TrueEdge> edges;
  for (const StructureJoint& j : found.joints) {
    if (!j.channel) return false;
    int& child = true_link[static_cast<std::size_t>(j.child_link)];
    if (child < 0) {
      for (std::size_t k = 0; k < recording.channel_of_joint.size(); ++k) {
        if (recording.channel_of_joint[k] == j.channel->channel)
          child = robot.tree.joints[k].child.value;
      }
    }
    edges.push_back(
        {true_link[static_cast<std::size_t>(j.parent_link)], child, j.type, j.channel->channel});
  }
  std::ranges::sort(edges);
  return edges == true_edges(robot, recording);
}

// With every two slides in series that have no marker between in the other order.
Structure with_slides_exchanged(Structure found) {
  for (StructureJoint& first : found.joints) {
    for (StructureJoint& second : found.joints) {
      const auto between = static_cast<std::size_t>(first.child_link);
      if (second.parent_link != first.child_link || !found.links[between].markers.empty()) continue;
      if (first.type == JointType::kPrismatic && second.type == JointType::kPrismatic)
        std::swap(first.channel, second.channel);
    }
  }
  return found;
}

}  // namespace

bool is_right(const Structure& found, const RandomRobot& robot, const RobotRecording& recording) {
  if (!found.free_markers.empty()) return false;
  return edges_right(found, robot, recording) ||
         edges_right(with_slides_exchanged(found), robot, recording);
}

bool is_right(const std::vector<AnchorEdge>& found, const RandomRobot& robot,
              const RobotRecording& recording) {
  const auto links = link_of_tags(robot);
  std::vector<TrueEdge> edges;
  for (const AnchorEdge& e : found) {
    const int a = links.at(e.first);
    const int b = links.at(e.second);
    // Edges of the 2019 tests have no direction: take the one the truth has.
    const bool forward = std::ranges::any_of(robot.tree.joints, [&](const Joint& j) {
      return j.parent.value == a && j.child.value == b;
    });
    edges.push_back({forward ? a : b, forward ? b : a, e.type, e.channel});
  }
  std::ranges::sort(edges);
  return edges == true_edges(robot, recording);
}

void print_structure(const Structure& found, const RandomRobot& robot,
                     const RobotRecording& recording) {
  const auto links = link_of_tags(robot);
  for (std::size_t l = 0; l < found.links.size(); ++l) {
    fmt::print("      link {}:", l);
    for (const TagId t : found.links[l].markers) fmt::print(" true{}", links.at(t));
    fmt::print("\n");
  }
  for (const StructureJoint& j : found.joints) {
    fmt::print("      {} -> {} {} by {} x{:.3g}", j.parent_link, j.child_link, to_string(j.type),
               j.channel ? j.channel->channel : -1, j.channel ? j.channel->scale : 0.0);
    for (const ChannelTerm& c : j.couplings) fmt::print(" + {} x{:.3g}", c.channel, c.scale);
    fmt::print("  travel {:.3f} rms {:.4f} {:.4f} log-odds {:.1f}\n", j.travel, j.rotation_rms_rad,
               j.translation_rms_m, j.log_odds);
  }
  for (const TagId t : found.free_markers) fmt::print("      free: true{}\n", links.at(t));
  for (const TrueEdge& e : true_edges(robot, recording)) {
    fmt::print("      truth {} -> {} {} by {}\n", e.parent, e.child, to_string(e.type), e.channel);
  }
}

}  // namespace kinescope
