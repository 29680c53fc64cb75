// SPDX-License-Identifier: Apache-2.0
//
// Robots nobody would build: branches, all joint types, axes anywhere, right angles among the
// turns.
#pragma once

#include <numbers>
#include <string>

#include "kinematics/core/rng.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// Half of the poses hold a turn by 90 degrees, where roll, pitch and yaw are singular.
inline Pose random_pose(Rng& rng) {
  const Eigen::Vector3d translation = rng.normal3(0.3);
  if (rng.index(2) == 0) return {exp_rotation(rng.unit3() * rng.uniform(0.0, 3.1)), translation};
  const double pitch = rng.index(2) == 0 ? 0.5 * std::numbers::pi : -0.5 * std::numbers::pi;
  return {exp_rotation(Eigen::Vector3d::UnitZ() * rng.uniform(-3.1, 3.1)) *
              exp_rotation(Eigen::Vector3d::UnitY() * pitch) *
              exp_rotation(Eigen::Vector3d::UnitX() * rng.uniform(-3.1, 3.1)),
          translation};
}

inline Joint random_joint(Rng& rng, int index, int links) {
  Joint joint;
  joint.name = "joint" + std::to_string(index);
  const int type = rng.index(5);
  joint.type = type < 2   ? JointType::kRevolute
               : type < 4 ? JointType::kPrismatic
                          : JointType::kFixed;
  joint.parent = LinkId{rng.index(links)};
  joint.child = LinkId{links};
  joint.T_parent_joint = random_pose(rng);
  if (joint.type == JointType::kFixed) return joint;
  joint.axis = rng.index(3) == 0 ? Eigen::Vector3d::UnitY().eval() : rng.unit3();
  if (rng.index(3) != 0) joint.limits = JointLimits{rng.uniform(-3.0, -0.1), rng.uniform(0.1, 3.0)};
  return joint;
}

inline KinematicTree random_tree(Rng& rng, int joints, int markers) {
  KinematicTree tree;
  tree.name = "random";
  tree.links.push_back({"base"});
  for (int j = 0; j < joints; ++j) {
    tree.joints.push_back(random_joint(rng, j + 1, static_cast<int>(tree.links.size())));
    tree.links.push_back({"link" + std::to_string(j + 1)});
  }
  for (int m = 0; m < markers; ++m) {
    tree.markers.push_back({.id = TagId{7 * m},
                            .link = LinkId{rng.index(static_cast<int>(tree.links.size()))},
                            .T_link_marker = random_pose(rng),
                            .size_m = rng.index(4) == 0 ? 0.0 : rng.uniform(0.01, 0.2)});
  }
  return tree;
}

/// One value a joint: rad within half a turn, m within 0.5.
inline Eigen::VectorXd random_values(Rng& rng, const KinematicTree& tree) {
  Eigen::VectorXd values(static_cast<Eigen::Index>(tree.joints.size()));
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const double reach = tree.joints[j].type == JointType::kRevolute ? std::numbers::pi : 0.5;
    values[static_cast<Eigen::Index>(j)] = rng.uniform(-reach, reach);
  }
  return values;
}

/// The larger of the distance (m) and the angle (rad) between two poses. The chord of the angle,
/// which, unlike the arc cosine, is exact near zero.
inline double pose_distance(const Pose& a, const Pose& b) {
  return std::max((a.translation - b.translation).norm(), (a.matrix3() - b.matrix3()).norm());
}

}  // namespace kinescope
