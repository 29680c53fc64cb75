// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/chain.h"

#include <algorithm>

namespace kinescope::bundle {
namespace {

Vector6d unit_twist(const ChainJoint& joint) {
  Vector6d twist = Vector6d::Zero();
  if (joint.type == JointType::kRevolute) twist.head<3>() = joint.axis;
  if (joint.type == JointType::kPrismatic) twist.tail<3>() = joint.axis;
  return twist;
}

// Joint k from child to parent, (T_parent_joint exp(axis q) exp(correction))^-1; `rest` is
// everything behind it, and is led on to before it.
void go_up(const ChainJoint& joint, std::size_t k, Pose& rest, ChainDerivatives& out) {
  rest = joint.T_parent_joint.inverse() * rest;
  out.d_joint[k] = -adjoint(rest.inverse());
  out.d_value[k] = out.d_joint[k] * unit_twist(joint);
  rest = joint_motion(joint.type, joint.axis, -joint.value) * rest;
  if (!joint.correction.isZero(0.0)) rest = exp_pose(-joint.correction) * rest;
  out.d_link[k] = -adjoint(rest.inverse());
}

}  // namespace

ChainDerivatives differentiate_chain(const Pose& T_camera_base, std::span<const ChainJoint> joints,
                                     const Pose& T_link_marker) {
  ChainDerivatives out;
  out.d_joint.resize(joints.size());
  out.d_value.resize(joints.size());
  out.d_link.resize(joints.size());
  // From the marker inwards; `rest` is everything behind the place that is perturbed.
  Pose rest = T_link_marker;
  for (std::size_t k = joints.size(); k-- > 0;) {
    const ChainJoint& joint = joints[k];
    if (joint.upward) {
      go_up(joint, k, rest, out);
      continue;
    }
    out.d_link[k] = adjoint(rest.inverse());
    if (!joint.correction.isZero(0.0)) rest = exp_pose(joint.correction) * rest;
    out.d_value[k] = adjoint(rest.inverse()) * unit_twist(joint);
    rest = joint_motion(joint.type, joint.axis, joint.value) * rest;
    out.d_joint[k] = adjoint(rest.inverse());
    rest = joint.T_parent_joint * rest;
  }
  out.d_camera_base = adjoint(rest.inverse());
  out.T_camera_marker = T_camera_base * rest;
  return out;
}

Pose compose_chain(const Pose& T_camera_base, std::span<const ChainJoint> joints,
                   const Pose& T_link_marker) {
  Pose rest = T_link_marker;
  for (std::size_t k = joints.size(); k-- > 0;) {
    const ChainJoint& joint = joints[k];
    const bool corrected = !joint.correction.isZero(0.0);
    if (joint.upward) {
      rest = joint_motion(joint.type, joint.axis, -joint.value) *
             (joint.T_parent_joint.inverse() * rest);
      if (corrected) rest = exp_pose(-joint.correction) * rest;
      continue;
    }
    if (corrected) rest = exp_pose(joint.correction) * rest;
    rest = joint.T_parent_joint * (joint_motion(joint.type, joint.axis, joint.value) * rest);
  }
  return T_camera_base * rest;
}

Pose grown(const Growth& growth, const Pose& T_camera_base, const Pose& T_camera_marker) {
  Pose T_base_marker = T_camera_base.inverse() * T_camera_marker;
  T_base_marker.translation = (1.0 + growth.relative) * T_base_marker.translation + growth.shift_m;
  return T_camera_base * T_base_marker;
}

void grow(const Growth& growth, const Pose& T_camera_base, ChainDerivatives& chain) {
  const double factor = 1.0 + growth.relative;
  chain.T_camera_marker = grown(growth, T_camera_base, chain.T_camera_marker);
  chain.d_camera_base = adjoint(chain.T_camera_marker.inverse() * T_camera_base);
  // What moves the marker by a turn and a shift moves it by that turn and a larger shift.
  const auto enlarge = [factor](auto& d) { d.template bottomRows<3>() *= factor; };
  std::ranges::for_each(chain.d_joint, enlarge);
  std::ranges::for_each(chain.d_value, enlarge);
  std::ranges::for_each(chain.d_link, enlarge);
  enlarge(chain.d_mount);
}

}  // namespace kinescope::bundle
