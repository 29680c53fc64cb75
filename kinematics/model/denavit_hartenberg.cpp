// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/denavit_hartenberg.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "kinematics/core/error.h"
#include "kinematics/model/axis_geometry.h"
#include "kinematics/model/common_normal.h"

namespace kinescope {
namespace {

Pose motion_along(const Eigen::Vector3d& axis, double turn, double shift) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(turn, axis)), shift * axis};
}

Pose step_pose(const DhStep& step) {
  return motion_along(Eigen::Vector3d::UnitZ(), step.theta, step.d) *
         motion_along(Eigen::Vector3d::UnitX(), step.alpha, step.a) *
         motion_along(Eigen::Vector3d::UnitY(), step.beta, 0.0);
}

DhNormal normal_between(const Pose& frame, const PlacedAxis& axis) {
  const Eigen::Vector3d z = frame.rotation * Eigen::Vector3d::UnitZ();
  if (!is_nearly_parallel(z, axis.direction)) return DhNormal::kCommon;
  if (axis.type == JointType::kPrismatic) return DhNormal::kDirection;
  const double away = in_plane_across(frame.translation, z, axis).norm();
  return away < kOneLine_m ? DhNormal::kOneLine : DhNormal::kParallel;
}

// Of an axis that slides the line through the origin of `frame` is taken.
DhStep common_step(const Pose& frame, const PlacedAxis& axis) {
  const Eigen::Vector3d z = frame.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d across = z.cross(axis.direction);
  const Eigen::Vector3d normal = across.normalized();
  DhStep out{.normal = DhNormal::kCommon};
  out.theta = angle_about(z, frame.rotation * Eigen::Vector3d::UnitX(), normal);
  out.alpha = std::atan2(across.norm(), z.dot(axis.direction));
  if (axis.type == JointType::kPrismatic) return out;
  out.d = normal_feet(frame.translation, z, axis).along_first;
  out.a = normal.dot(axis.point - frame.translation);
  return out;
}

DhStep parallel_step(const Pose& frame, const PlacedAxis& axis, DhNormal normal) {
  DhStep out{.normal = normal};
  const Eigen::Vector3d z = frame.rotation * Eigen::Vector3d::UnitZ();
  if (normal != DhNormal::kDirection) {
    const Eigen::Vector3d to =
        frame.rotation.conjugate() * in_plane_across(frame.translation, z, axis);
    out.a = to.norm();
    out.theta = out.a > 0.0 ? std::atan2(to.y(), to.x()) : 0.0;
  }
  const Eigen::Vector3d direction =
      motion_along(Eigen::Vector3d::UnitZ(), out.theta, 0.0).rotation.conjugate() *
      (frame.rotation.conjugate() * axis.direction);
  out.beta = std::asin(std::clamp(direction.x(), -1.0, 1.0));
  out.alpha = std::atan2(-direction.y(), direction.z());
  return out;
}

// The axis' own frame where all joints are at 0: z along it.
Pose axis_frame(const KinematicTree& tree, const std::vector<Pose>& T_base_link, JointId id) {
  const Joint& joint = tree.joints[id.index()];
  return T_base_link[joint.parent.index()] * joint.T_parent_joint *
         Pose{rotation_to_axis(joint.axis), Eigen::Vector3d::Zero()};
}

PlacedAxis placed_axis(const KinematicTree& tree, const std::vector<Pose>& T_base_link,
                       JointId id) {
  const Pose frame = axis_frame(tree, T_base_link, id);
  return {tree.joints[id.index()].type, frame.translation,
          frame.rotation * Eigen::Vector3d::UnitZ(), -1};
}

DhChain chain_to(const KinematicTree& tree, LinkId tip, const DhChain* like) {
  DhChain out{.tip = tip, .joints = {}, .base = {}, .steps = {}, .tool = {}};
  for (const JointId id : tree.path_to(tip))
    if (is_movable(tree.joints[id.index()])) out.joints.push_back(id);
  const std::vector<Pose> T_base_link =
      forward_kinematics(tree, Eigen::VectorXd::Zero(std::ssize(tree.joints)));
  const std::size_t n = out.joints.size();
  KINESCOPE_CHECK(n > 0, "a link that a joint moves");
  KINESCOPE_CHECK(like == nullptr || like->joints == out.joints, "the same robot");
  out.base = axis_frame(tree, T_base_link, out.joints.front());
  Pose frame = out.base;
  for (std::size_t k = 0; k + 1 < n; ++k) {
    const PlacedAxis next = placed_axis(tree, T_base_link, out.joints[k + 1]);
    const DhNormal normal = like != nullptr ? like->steps[k].normal : normal_between(frame, next);
    DhStep step =
        normal == DhNormal::kCommon ? common_step(frame, next) : parallel_step(frame, next, normal);
    if (k == 0) {
      out.base = out.base * motion_along(Eigen::Vector3d::UnitZ(), step.theta, step.d);
      step.theta = step.d = 0.0;
      frame = out.base;
    }
    frame = frame * step_pose(step);
    out.steps.push_back(step);
  }
  out.steps.push_back({});
  out.tool = frame.inverse() * T_base_link[tip.index()];
  return out;
}

}  // namespace

std::vector<LinkId> chain_tips(const KinematicTree& tree) {
  std::vector<LinkId> out;
  for (std::size_t l = 0; l < tree.links.size(); ++l) {
    const LinkId link{static_cast<int>(l)};
    if (std::ranges::find(tree.joints, link, &Joint::parent) != tree.joints.end()) continue;
    const std::vector<JointId> path = tree.path_to(link);
    const auto moves = [&](JointId id) { return is_movable(tree.joints[id.index()]); };
    if (std::ranges::any_of(path, moves)) out.push_back(link);
  }
  return out;
}

DhChain dh_chain(const KinematicTree& tree, LinkId tip) { return chain_to(tree, tip, nullptr); }

DhChain dh_chain(const KinematicTree& tree, const DhChain& like) {
  return chain_to(tree, like.tip, &like);
}

std::vector<DhStep> dh_rows(const std::vector<DhStep>& steps, DhConvention convention) {
  std::vector<DhStep> out = steps;
  if (convention == DhConvention::kStandard) return out;
  for (std::size_t k = 0; k < out.size(); ++k) {
    const DhStep before = k == 0 ? DhStep{} : steps[k - 1];
    out[k].a = before.a;
    out[k].alpha = before.alpha;
    out[k].beta = before.beta;
    out[k].normal = before.normal;
  }
  return out;
}

}  // namespace kinescope
