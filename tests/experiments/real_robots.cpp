// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/real_robots.h"

#include <numbers>

#include <fmt/format.h>

namespace kinescope::real {
namespace {

constexpr double kRightAngle = 0.5 * std::numbers::pi;

Pose turn_x(double angle) { return {exp_rotation({angle, 0.0, 0.0}), Eigen::Vector3d::Zero()}; }
Pose turn_z(double angle) { return {exp_rotation({0.0, 0.0, angle}), Eigen::Vector3d::Zero()}; }
Pose shift(double x, double z) { return {Eigen::Quaterniond::Identity(), {x, 0.0, z}}; }

void add_joint(KinematicTree& tree, const std::string& name, JointType type, const Pose& T) {
  const LinkId parent{static_cast<int>(tree.links.size()) - 1};
  tree.links.push_back({fmt::format("link{}", tree.links.size())});
  Joint joint;
  joint.name = name;
  joint.type = type;
  joint.parent = parent;
  joint.child = LinkId{parent.value + 1};
  joint.T_parent_joint = T;
  tree.joints.push_back(joint);
}

void add_flange(KinematicTree& tree, const Pose& T) {
  add_joint(tree, "flange_joint", JointType::kFixed, T);
  tree.links.back().name = "flange";
}

KinematicTree base_only(const std::string& name) {
  KinematicTree tree;
  tree.name = name;
  tree.links.push_back({"base"});
  return tree;
}

}  // namespace

KinematicTree classic_dh(const std::string& name, const std::vector<DhRow>& rows,
                         const std::vector<std::string>& joints) {
  KinematicTree tree = base_only(name);
  Pose behind;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const DhRow& row = rows[k];
    add_joint(tree, joints.at(k), JointType::kRevolute, behind * turn_z(row.theta_offset));
    behind = shift(row.a, row.d) * turn_x(row.alpha);
  }
  add_flange(tree, behind);
  return tree;
}

KinematicTree modified_dh(const std::string& name, const std::vector<DhRow>& rows,
                          const std::vector<std::string>& joints, double flange_d) {
  KinematicTree tree = base_only(name);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const DhRow& row = rows[k];
    add_joint(tree, joints.at(k), JointType::kRevolute,
              turn_x(row.alpha) * shift(row.a, 0.0) * shift(0.0, row.d) * turn_z(row.theta_offset));
  }
  add_flange(tree, shift(0.0, flange_d));
  return tree;
}

KinematicTree from_screws(const std::string& name, const std::vector<ScrewAxis>& axes,
                          const std::vector<std::string>& joints) {
  KinematicTree tree = base_only(name);
  Pose T_base_before;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const Pose T_base_joint{rotation_to_axis(axes[k].direction), axes[k].point};
    add_joint(tree, joints.at(k), JointType::kRevolute, T_base_before.inverse() * T_base_joint);
    T_base_before = T_base_joint;
  }
  return tree;
}

KinematicTree franka(const std::string& name, const std::vector<std::string>& joints) {
  return modified_dh(name,
                     {{.d = 0.333},
                      {.alpha = -kRightAngle},
                      {.d = 0.316, .alpha = kRightAngle},
                      {.a = 0.0825, .alpha = kRightAngle},
                      {.a = -0.0825, .d = 0.384, .alpha = -kRightAngle},
                      {.alpha = kRightAngle},
                      {.a = 0.088, .alpha = kRightAngle}},
                     joints, 0.107);
}

KinematicTree iiwa14(const std::vector<std::string>& joints) {
  return classic_dh("iiwa14",
                    {{.d = 0.36, .alpha = -kRightAngle},
                     {.alpha = kRightAngle},
                     {.d = 0.42, .alpha = kRightAngle},
                     {.alpha = -kRightAngle},
                     {.d = 0.4, .alpha = -kRightAngle},
                     {.alpha = kRightAngle},
                     {.d = 0.126}},
                    joints);
}

KinematicTree ur10(const std::vector<std::string>& joints) {
  return classic_dh("ur10",
                    {{.d = 0.1273, .alpha = kRightAngle},
                     {.a = -0.612},
                     {.a = -0.5723},
                     {.d = 0.163941, .alpha = kRightAngle},
                     {.d = 0.1157, .alpha = -kRightAngle},
                     {.d = 0.0922}},
                    joints);
}

}  // namespace kinescope::real
