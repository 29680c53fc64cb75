// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/resting_joint.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include "kinematics/core/median.h"
#include "kinematics/structure/attach_marker.h"
#include "kinematics/structure/doubts.h"

namespace kinescope {
namespace {

Eigen::MatrixXd without_column(const Eigen::MatrixXd& matrix, Eigen::Index column) {
  if (matrix.cols() <= column) return matrix;
  Eigen::MatrixXd out(matrix.rows(), matrix.cols() - 1);
  out << matrix.leftCols(column), matrix.rightCols(matrix.cols() - column - 1);
  return out;
}

// Markers by id.
StructureLink united(const StructureLink& parent, const StructureLink& child,
                     const Pose& T_parent_child) {
  std::vector<std::pair<TagId, Pose>> markers;
  for (std::size_t m = 0; m < parent.markers.size(); ++m)
    markers.emplace_back(parent.markers[m], parent.T_reference_marker[m]);
  for (std::size_t m = 0; m < child.markers.size(); ++m)
    markers.emplace_back(child.markers[m], T_parent_child * child.T_reference_marker[m]);
  std::ranges::sort(markers, {}, &std::pair<TagId, Pose>::first);
  StructureLink out;
  for (const auto& [id, T] : markers) {
    out.markers.push_back(id);
    out.T_reference_marker.push_back(T);
  }
  return out;
}

void find_idle_channels(const StructureJoint& without, Structure& out) {
  std::set<int> idle(out.idle_channels.begin(), out.idle_channels.end());
  if (without.channel) idle.insert(without.channel->channel);
  for (const ChannelTerm& term : without.couplings) idle.insert(term.channel);
  for (const StructureJoint& joint : out.joints) {
    if (joint.channel) idle.erase(joint.channel->channel);
    for (const ChannelTerm& term : joint.couplings) idle.erase(term.channel);
  }
  out.idle_channels.assign(idle.begin(), idle.end());
}

// Reference marker to reference marker, at the usual value.
Pose T_parent_child(const Structure& structure, std::size_t joint, const JointLog& log) {
  const StructureJoint& of = structure.joints[joint];
  return of.T_parent_joint *
         joint_motion(of.type, Eigen::Vector3d::UnitZ(), usual_value(structure, joint, log)) *
         of.T_joint_child;
}

// Without the joint, what it carried being part of `link`.
Structure with_child_on(const Structure& structure, std::size_t joint, int link,
                        const Pose& T_link_child, const JointLog& log) {
  const int child = structure.joints[joint].child_link;
  const auto index = static_cast<std::ptrdiff_t>(joint);
  Structure out = structure;
  out.rivals.clear();
  out.joints.erase(out.joints.begin() + index);
  out.joint_values = without_column(structure.joint_values, index);
  find_idle_channels(structure.joints[joint], out);
  for (StructureJoint& other : out.joints) {
    if (other.parent_link != child) continue;
    other.parent_link = link;
    other.T_parent_joint = T_link_child * other.T_parent_joint;
  }
  StructureLink& into = out.links[static_cast<std::size_t>(link)];
  into = united(into, out.links[static_cast<std::size_t>(child)], T_link_child);
  take_first_reference(out, link);
  out.links.erase(out.links.begin() + child);
  for (StructureJoint& other : out.joints) {
    if (other.parent_link > child) --other.parent_link;
    if (other.child_link > child) --other.child_link;
  }
  structure_search::doubt_shared_channels(log, out);
  return out;
}

}  // namespace

bool hardly_moves(const StructureJoint& joint) {
  // Twice the errors' size in compressed videos of a marker at rest; a joint that turns by five
  // times their size is told from rest by the images.
  constexpr double kHardly = 5.0;
  const double error =
      joint.type == JointType::kRevolute ? joint.rotation_rms_rad : joint.translation_rms_m;
  return joint.travel < kHardly * error;
}

double usual_value(const Structure& structure, std::size_t joint, const JointLog& log) {
  const StructureJoint& of = structure.joints[joint];
  const auto median = [](const auto& column) {
    std::vector<double> values;
    for (const double value : column)
      if (std::isfinite(value)) values.push_back(value);
    return values.empty() ? 0.0 : median_of(std::move(values));
  };
  if (of.channel)
    return of.channel->scale * median(log.values.col(of.channel->channel)) + of.offset;
  const auto column = static_cast<Eigen::Index>(joint);
  return structure.joint_values.cols() > column ? median(structure.joint_values.col(column)) : 0.0;
}

Structure with_joint_at_rest(const Structure& structure, std::size_t joint, const JointLog& log) {
  return with_child_on(structure, joint, structure.joints[joint].parent_link,
                       T_parent_child(structure, joint, log), log);
}

std::optional<Structure> with_joint_undone(const Structure& structure, std::size_t joint,
                                           const JointLog& log) {
  const StructureJoint& undoes = structure.joints[joint];
  const auto before =
      std::ranges::find(structure.joints, undoes.parent_link, &StructureJoint::child_link);
  if (before == structure.joints.end() || !undoes.channel || !before->channel ||
      undoes.channel->channel != before->channel->channel)
    return std::nullopt;
  const auto index = static_cast<std::size_t>(before - structure.joints.begin());
  return with_child_on(
      structure, joint, before->parent_link,
      T_parent_child(structure, index, log) * T_parent_child(structure, joint, log), log);
}

}  // namespace kinescope
