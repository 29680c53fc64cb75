// SPDX-License-Identifier: Apache-2.0
//
// How far two robots of the same names stand from each other in one posture.
#pragma once

#include <algorithm>

#include "kinematics/model/kinematic_tree.h"
#include "tests/kinematics/model/random_tree.h"

namespace kinescope {

// Exact algebra: about 10 products of numbers up to 10, a few epsilon (2e-16) each.
inline constexpr double kExact = 1e-12;

/// Largest difference of forward kinematics over links and markers, m or rad, by name.
inline double worst_difference(const KinematicTree& a, const KinematicTree& b,
                               const Eigen::VectorXd& values) {
  const std::vector<Pose> fk_a = forward_kinematics(a, values);
  const std::vector<Pose> fk_b = forward_kinematics(b, values);
  double worst = 0.0;
  for (std::size_t i = 0; i < a.links.size(); ++i) {
    worst = std::max(worst, pose_distance(fk_a[i], fk_b[b.link(a.links[i].name)->index()]));
  }
  for (const Marker& marker : a.markers) {
    const Marker& other = *b.marker(marker.id);
    worst = std::max(worst, pose_distance(fk_a[marker.link.index()] * marker.T_link_marker,
                                          fk_b[other.link.index()] * other.T_link_marker));
  }
  return worst;
}

}  // namespace kinescope
