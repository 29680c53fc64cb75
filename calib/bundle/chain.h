// SPDX-License-Identifier: Apache-2.0
//
// The chain from the camera to a marker and its derivatives:
//   T_camera_marker = T_camera_base * prod_k (T_parent_joint_k * exp(axis_k q_k)) * T_link_marker,
// with the inverse factor of a joint on the way from a camera on the robot up to its base, and
// T_camera_link in place of T_camera_base then.
// Every derivative is the 6-vector d of a right perturbation of T_camera_marker.
#pragma once

#include <span>
#include <vector>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope::bundle {

/// One joint on the way, at one instant.
struct ChainJoint {
  JointType type = JointType::kFixed;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  Pose T_parent_joint;
  double value = 0.0;                      ///< rad or m
  Vector6d correction = Vector6d::Zero();  ///< a twist behind the motion, in the link's frame
  bool upward = false;                     ///< from child to parent
};

struct ChainDerivatives {
  Pose T_camera_marker;
  Matrix6d d_camera_base;                   ///< of a right perturbation of T_camera_base
  std::vector<Matrix6d> d_joint;            ///< of T_parent_joint, from the base outwards
  std::vector<Vector6d> d_value;            ///< of the joint value, per rad or m
  std::vector<Matrix6d> d_link;             ///< of a right perturbation of the link's frame
  Matrix6d d_mount = Matrix6d::Identity();  ///< of a right perturbation of T_link_marker
};

/// Murray, Li, Sastry 1994, section 3.2.4, in body coordinates.
[[nodiscard]] ChainDerivatives differentiate_chain(const Pose& T_camera_base,
                                                   std::span<const ChainJoint> joints,
                                                   const Pose& T_link_marker);

/// T_camera_marker alone.
[[nodiscard]] Pose compose_chain(const Pose& T_camera_base, std::span<const ChainJoint> joints,
                                 const Pose& T_link_marker);

/// All that joints carry, larger by a factor as seen from the base's origin, and shifted.
struct Growth {
  double relative = 0.0;                              ///< of distances, minus 1
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();  ///< in the base's frame
  [[nodiscard]] bool operator==(const Growth&) const = default;
};

/// The marker as a growth moves it.
[[nodiscard]] Pose grown(const Growth& growth, const Pose& T_camera_base,
                         const Pose& T_camera_marker);
/// The same with all derivatives.
void grow(const Growth& growth, const Pose& T_camera_base, ChainDerivatives& chain);

}  // namespace kinescope::bundle
