// SPDX-License-Identifier: Apache-2.0
//
// Our model as KDL's, built by hand. Only for programs that were built with KDL.
#pragma once

#include <kdl/tree.hpp>

#include "kinematics/core/error.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

[[nodiscard]] inline KDL::Vector to_kdl(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

[[nodiscard]] inline KDL::Frame to_kdl(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  return {KDL::Rotation::Quaternion(q.x(), q.y(), q.z(), q.w()), to_kdl(pose.translation)};
}

[[nodiscard]] inline KDL::RigidBodyInertia to_kdl(const InertialParameters& parameters) {
  const CentralInertia central = to_central(parameters);
  const Eigen::Matrix3d& I = central.inertia_kgm2;
  return KDL::RigidBodyInertia(
      central.mass_kg, to_kdl(central.centre_m),
      KDL::RotationalInertia(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)));
}

[[nodiscard]] inline KDL::Joint to_kdl(const Joint& joint) {
  if (joint.type == JointType::kFixed) return KDL::Joint(joint.name, KDL::Joint::None);
  const KDL::Vector axis = to_kdl((joint.T_parent_joint.rotation * joint.axis).eval());
  return KDL::Joint(
      joint.name, to_kdl(joint.T_parent_joint.translation), axis,
      joint.type == JointType::kRevolute ? KDL::Joint::RotAxis : KDL::Joint::TransAxis);
}

/// Links and joints by our names. KDL knows no motor inertia.
[[nodiscard]] inline KDL::Tree to_kdl(const DynamicModel& model) {
  KDL::Tree tree(model.tree.links[0].name);
  for (const Joint& joint : model.tree.joints) {
    const bool added = tree.addSegment(
        KDL::Segment(model.tree.links[joint.child.index()].name, to_kdl(joint),
                     to_kdl(joint.T_parent_joint), to_kdl(model.links[joint.child.index()])),
        model.tree.links[joint.parent.index()].name);
    KINESCOPE_CHECK(added, "parents stand before children");
  }
  return tree;
}

}  // namespace kinescope
