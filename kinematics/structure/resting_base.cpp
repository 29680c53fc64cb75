// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/resting_base.h"

#include <algorithm>

#include "kinematics/structure/resting_joint.h"

namespace kinescope {
namespace {

// Of the joint that carries all; -1: there is none.
int joint_below_all(const Structure& structure) {
  if (structure.links.empty() || !structure.links.front().markers.empty()) return -1;
  int out = -1;
  for (std::size_t j = 0; j < structure.joints.size(); ++j) {
    if (structure.joints[j].parent_link != 0) continue;
    if (out >= 0) return -1;
    out = static_cast<int>(j);
  }
  if (out < 0 || structure.joints[static_cast<std::size_t>(out)].channel) return -1;
  return std::ranges::any_of(structure.joints,
                             [](const StructureJoint& joint) { return joint.channel.has_value(); })
             ? out
             : -1;
}

}  // namespace

std::optional<Structure> with_base_at_rest(const Structure& structure, const JointLog& log) {
  const int below = joint_below_all(structure);
  if (below < 0 || structure.joint_values.cols() <= below) return std::nullopt;
  return with_joint_at_rest(structure, static_cast<std::size_t>(below), log);
}

}  // namespace kinescope
