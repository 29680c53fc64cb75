// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/resting_base.h"

#include <algorithm>

#include "kinematics/structure/resting_joint.h"

namespace kinescope {
namespace {

// A channel that leaves more of the motion than it explains drives something else, if anything.
bool is_driven(const StructureJoint& joint) {
  constexpr double kHalf = 0.5;
  return joint.channel && joint.unexplained < kHalf;
}

// Of the joint that carries all, and that nothing drives; -1: there is none.
int joint_below_all(const Structure& structure) {
  if (structure.links.empty() || !structure.links.front().markers.empty()) return -1;
  int out = -1;
  for (std::size_t j = 0; j < structure.joints.size(); ++j) {
    if (structure.joints[j].parent_link != 0) continue;
    if (out >= 0) return -1;
    out = static_cast<int>(j);
  }
  if (out < 0 || is_driven(structure.joints[static_cast<std::size_t>(out)])) return -1;
  return std::ranges::any_of(structure.joints, is_driven) ? out : -1;
}

}  // namespace

std::optional<Structure> with_base_at_rest(const Structure& structure, const JointLog& log) {
  const int below = joint_below_all(structure);
  if (below < 0) return std::nullopt;
  const bool is_of_channel = structure.joints[static_cast<std::size_t>(below)].channel.has_value();
  if (!is_of_channel && structure.joint_values.cols() <= below) return std::nullopt;
  return with_joint_at_rest(structure, static_cast<std::size_t>(below), log);
}

}  // namespace kinescope
