// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/kinematic_tree.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

Vector6d unit_twist(const Joint& joint) {
  Vector6d twist = Vector6d::Zero();
  if (joint.type == JointType::kRevolute) twist.head<3>() = joint.axis;
  if (joint.type == JointType::kPrismatic) twist.tail<3>() = joint.axis;
  return twist;
}

}  // namespace

std::string_view to_string(JointType type) {
  switch (type) {
    case JointType::kFixed:
      return "fixed";
    case JointType::kRevolute:
      return "revolute";
    case JointType::kPrismatic:
      return "prismatic";
  }
  return "unknown";
}

std::optional<LinkId> KinematicTree::link(std::string_view link_name) const {
  const auto found = std::ranges::find(links, link_name, &Link::name);
  if (found == links.end()) return std::nullopt;
  return LinkId{static_cast<int>(found - links.begin())};
}

std::optional<JointId> KinematicTree::joint(std::string_view joint_name) const {
  const auto found = std::ranges::find(joints, joint_name, &Joint::name);
  if (found == joints.end()) return std::nullopt;
  return JointId{static_cast<int>(found - joints.begin())};
}

const Marker* KinematicTree::marker(TagId id) const {
  const auto found = std::ranges::find(markers, id, &Marker::id);
  return found == markers.end() ? nullptr : &*found;
}

std::optional<JointId> KinematicTree::parent_joint(LinkId link) const {
  const auto found = std::ranges::find(joints, link, &Joint::child);
  if (found == joints.end()) return std::nullopt;
  return JointId{static_cast<int>(found - joints.begin())};
}

std::vector<JointId> KinematicTree::path_to(LinkId link) const {
  std::vector<JointId> path;
  for (auto up = parent_joint(link); up; up = parent_joint(joints[up->index()].parent)) {
    path.push_back(*up);
    KINESCOPE_CHECK(path.size() <= joints.size(), "the joints form a loop");
  }
  std::ranges::reverse(path);
  return path;
}

void check_tree(const KinematicTree& tree) {
  KINESCOPE_CHECK(!tree.links.empty(), "a tree has at least its root");
  KINESCOPE_CHECK(tree.joints.size() + 1 == tree.links.size(), "one joint a link but the root");
  std::set<int> known{0};
  for (const Joint& joint : tree.joints) {
    KINESCOPE_CHECK(known.contains(joint.parent.value), "parents stand before children");
    KINESCOPE_CHECK(joint.child.value > 0 && joint.child.index() < tree.links.size(),
                    "a joint's child is a link of the tree");
    KINESCOPE_CHECK(known.insert(joint.child.value).second, "a link has one parent");
    KINESCOPE_CHECK(std::abs(joint.axis.norm() - 1.0) < 1e-9, "an axis is a unit vector");
  }
  std::set<std::string> names;
  for (const Link& link : tree.links) {
    KINESCOPE_CHECK(names.insert(link.name).second, "link names are unique");
  }
  names.clear();
  for (const Joint& joint : tree.joints) {
    KINESCOPE_CHECK(names.insert(joint.name).second, "joint names are unique");
  }
  for (const Marker& marker : tree.markers) {
    KINESCOPE_CHECK(known.contains(marker.link.value), "a marker sits on a link of the tree");
  }
}

Pose joint_motion(JointType type, const Eigen::Vector3d& axis, double value) {
  switch (type) {
    case JointType::kRevolute:
      return {exp_rotation(axis * value), Eigen::Vector3d::Zero()};
    case JointType::kPrismatic:
      return {Eigen::Quaterniond::Identity(), axis * value};
    case JointType::kFixed:
      break;
  }
  return {};
}

std::vector<Pose> forward_kinematics(const KinematicTree& tree, const Eigen::VectorXd& values) {
  KINESCOPE_CHECK(values.size() == static_cast<Eigen::Index>(tree.joints.size()),
                  "one value a joint");
  std::vector<Pose> T_base_link(tree.links.size());
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    T_base_link[joint.child.index()] =
        T_base_link[joint.parent.index()] * joint.T_parent_joint *
        joint_motion(joint.type, joint.axis, values[static_cast<Eigen::Index>(j)]);
  }
  return T_base_link;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> body_jacobian(const KinematicTree& tree,
                                                       const Eigen::VectorXd& values, LinkId link) {
  const std::vector<Pose> T_base_link = forward_kinematics(tree, values);
  const Pose T_link_base = T_base_link[link.index()].inverse();
  Eigen::Matrix<double, 6, Eigen::Dynamic> jacobian =
      Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, values.size());
  for (const JointId id : tree.path_to(link)) {
    const Joint& joint = tree.joints[id.index()];
    jacobian.col(id.value) =
        adjoint(T_link_base * T_base_link[joint.child.index()]) * unit_twist(joint);
  }
  return jacobian;
}

}  // namespace kinescope
