// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <set>

#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "kinematics/structure/structure.h"

namespace kinescope {
namespace {

// Letters, digits and '_' only, as URDF readers like names.
std::string sanitised(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
    out.push_back(plain ? c : '_');
  }
  return out;
}

std::string unique_name(const std::string& wanted, std::set<std::string>& taken) {
  std::string name = wanted;
  for (int n = 2; taken.contains(name); ++n) name = fmt::format("{}_{}", wanted, n);
  taken.insert(name);
  return name;
}

std::string joint_name(const StructureJoint& joint, std::size_t index, const JointLog& log) {
  if (joint.channel) {
    std::string name = sanitised(log.channels[static_cast<std::size_t>(joint.channel->channel)]);
    if (!name.empty()) return name;
  }
  return fmt::format("joint{}", index + 1);
}

}  // namespace

KinematicTree structure_tree(const Structure& structure, const JointLog& log) {
  KINESCOPE_CHECK(!structure.links.empty(), "a structure has a link 0");
  KinematicTree tree;
  std::set<std::string> taken;
  for (std::size_t l = 0; l < structure.links.size(); ++l) {
    tree.links.push_back({l == 0 ? std::string("base") : fmt::format("link{}", l)});
  }
  // The reference marker of every link (the camera for link 0) in the link's frame, its joint's
  // frame.
  std::vector<Pose> T_link_reference(structure.links.size());
  for (const StructureJoint& joint : structure.joints) {
    T_link_reference[static_cast<std::size_t>(joint.child_link)] = joint.T_joint_child;
  }
  for (std::size_t j = 0; j < structure.joints.size(); ++j) {
    const StructureJoint& joint = structure.joints[j];
    Joint& out = tree.joints.emplace_back();
    out.name = unique_name(joint_name(joint, j, log), taken);
    out.type = joint.type;
    out.parent = LinkId{joint.parent_link};
    out.child = LinkId{joint.child_link};
    out.T_parent_joint =
        T_link_reference[static_cast<std::size_t>(joint.parent_link)] * joint.T_parent_joint;
    out.offset = joint.offset;
    if (!joint.channel) continue;
    out.channel = log.channels[static_cast<std::size_t>(joint.channel->channel)];
    out.scale = joint.channel->scale;
    for (const ChannelCopy& copy : structure.copied_channels) {
      if (copy.of == joint.channel->channel)
        out.copies.push_back(log.channels[static_cast<std::size_t>(copy.channel)]);
    }
  }
  for (std::size_t l = 0; l < structure.links.size(); ++l) {
    const StructureLink& link = structure.links[l];
    for (std::size_t m = 0; m < link.markers.size(); ++m) {
      tree.markers.push_back({link.markers[m], LinkId{static_cast<int>(l)},
                              T_link_reference[l] * link.T_reference_marker[m], 0.0});
    }
  }
  return tree;
}

}  // namespace kinescope
