// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/resting_base.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kinematics/core/median.h"

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

double usual_value(const Structure& structure, int joint) {
  std::vector<double> values;
  for (const double value : structure.joint_values.col(joint))
    if (std::isfinite(value)) values.push_back(value);
  return values.empty() ? 0.0 : median_of(std::move(values));
}

Eigen::MatrixXd without_column(const Eigen::MatrixXd& matrix, Eigen::Index column) {
  Eigen::MatrixXd out(matrix.rows(), matrix.cols() - 1);
  out << matrix.leftCols(column), matrix.rightCols(matrix.cols() - column - 1);
  return out;
}

}  // namespace

std::optional<Structure> with_base_at_rest(const Structure& structure) {
  const int below = joint_below_all(structure);
  if (below < 0 || structure.joint_values.cols() <= below) return std::nullopt;
  const StructureJoint& joint = structure.joints[static_cast<std::size_t>(below)];
  const int child = joint.child_link;
  const Pose T_camera_reference =
      joint.T_parent_joint *
      joint_motion(joint.type, Eigen::Vector3d::UnitZ(), usual_value(structure, below)) *
      joint.T_joint_child;
  Structure out = structure;
  out.rivals.clear();
  out.links.front() = structure.links[static_cast<std::size_t>(child)];
  for (Pose& T : out.links.front().T_reference_marker) T = T_camera_reference * T;
  out.links.erase(out.links.begin() + child);
  out.joints.erase(out.joints.begin() + below);
  for (StructureJoint& other : out.joints) {
    if (other.parent_link == child) {
      other.parent_link = 0;
      other.T_parent_joint = T_camera_reference * other.T_parent_joint;
    } else if (other.parent_link > child) {
      --other.parent_link;
    }
    if (other.child_link > child) --other.child_link;
  }
  out.joint_values = without_column(structure.joint_values, below);
  return out;
}

}  // namespace kinescope
