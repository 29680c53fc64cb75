// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/attach_marker.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope {

void take_first_reference(Structure& structure, int link) {
  StructureLink& of = structure.links[static_cast<std::size_t>(link)];
  if (link == 0 || of.markers.empty()) return;
  const Pose T_new_old = of.T_reference_marker.front().inverse();
  for (Pose& T : of.T_reference_marker) T = T_new_old * T;
  for (StructureJoint& joint : structure.joints) {
    if (joint.parent_link == link) joint.T_parent_joint = T_new_old * joint.T_parent_joint;
    if (joint.child_link == link) joint.T_joint_child = joint.T_joint_child * T_new_old.inverse();
  }
}

Structure with_marker_on(Structure structure, TagId marker, int link, const Pose& T_link_marker) {
  const auto l = static_cast<std::size_t>(link);
  KINESCOPE_CHECK(l < structure.links.size(), "a link of the structure");
  const auto moving = std::ranges::find(structure.joints, link, &StructureJoint::child_link);
  const Pose T_link_reference = moving == structure.joints.end() ? Pose{} : moving->T_joint_child;
  StructureLink& on = structure.links[l];
  const auto at = std::ranges::upper_bound(on.markers, marker) - on.markers.begin();
  on.markers.insert(on.markers.begin() + at, marker);
  on.T_reference_marker.insert(on.T_reference_marker.begin() + at,
                               T_link_reference.inverse() * T_link_marker);
  if (at == 0) take_first_reference(structure, link);
  std::erase(structure.free_markers, marker);
  const std::string name = fmt::format("tag_{}", marker.value);
  std::erase_if(structure.doubts, [&](const StructureDoubt& doubt) {
    return doubt.names == std::vector<std::string>{name};
  });
  return structure;
}

}  // namespace kinescope
