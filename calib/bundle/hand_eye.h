// SPDX-License-Identifier: Apache-2.0
//
// Takes   markers' poses in the camera's frame and where a drawing has their links in the base's.
// Gives   where the base stands in the camera's frame, from any number of markers together.
// Method  T_camera_marker = T_camera_base T_base_link T_link_marker. With the marker's orientation
//         as measured, both halves are linear in R_camera_base, t_camera_base and the mount
//         (Shah 2013, section 3, rotations; Dornaika and Horaud 1998, eq. 10, translations), so
//         that the mounts and the translation are eliminated for good: a quadratic of the nine
//         entries of R_camera_base stays, whose least value over the rotations is sought from all
//         over them. Axes that are all parallel, slides alone, one joint alone are no special
//         cases: they leave directions in which the quadratic is flat unless another marker bends
//         it, and what no marker bends changes nothing that was measured.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "kinematics/core/pose.h"

namespace kinescope::bundle {

/// A measured pose and where the nominal robot has the link at that instant.
struct PosePair {
  Pose T_camera_marker;
  Pose T_base_link;
};

/// Sum over pairs of squared misfits (m and rad together: at arm's length, 1 m, a radian moves a
/// point by a metre), least over the mount, but for a constant:
///   x' quadratic x - 2 linear' x,   x = [R_camera_base by columns; t_camera_base (m)].
struct HandEyeCost {
  Eigen::Matrix<double, 12, 12> quadratic = Eigen::Matrix<double, 12, 12>::Zero();
  Eigen::Vector<double, 12> linear = Eigen::Vector<double, 12>::Zero();

  void add(const HandEyeCost& other, double weight);
};

/// The cost of one marker on one link.
[[nodiscard]] HandEyeCost hand_eye_cost(const std::vector<PosePair>& pairs);

/// T_camera_base of the least cost; of several such poses always the same one, and of mounts the
/// short ones.
[[nodiscard]] Pose best_base(const HandEyeCost& cost);

/// The mean mount of a marker for a known base, T_link_marker, and the rms misfit that it leaves.
struct MountFit {
  Pose T_link_marker;
  double misfit = 0.0;  ///< m and rad together, as HandEyeCost
};
[[nodiscard]] MountFit fit_mount(const std::vector<PosePair>& pairs, const Pose& T_camera_base);

}  // namespace kinescope::bundle
