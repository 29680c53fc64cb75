// SPDX-License-Identifier: Apache-2.0
//
// Common normal of two axes (Denavit and Hartenberg 1955), and the plane across the first one where
// they have none worth the name (Hayati and Mirmirani 1985).
#pragma once

#include <Eigen/Core>

#include "kinematics/model/axis_geometry.h"

namespace kinescope {

/// Sine of the angle below which axes count as parallel. Robots are drawn with 0 or 30 degrees and
/// more; both descriptions hold in between (axis_geometry_test compares them at 10 and at 20).
inline constexpr double kParallelSine = 0.25;
/// Parallel axes nearer than this (m) have no direction from one to the other that a calibration,
/// exact to tenths of a millimetre, could say to a tenth of a radian.
inline constexpr double kOneLine_m = 5e-3;

/// Unit directions.
[[nodiscard]] bool is_nearly_parallel(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// Where the common normal meets both lines, m.
struct NormalFeet {
  double along_first = 0.0;   ///< from `origin`
  double along_second = 0.0;  ///< from the axis' point
};

/// Of the line through `origin` along `z` (unit) and an axis that is not parallel to it.
[[nodiscard]] NormalFeet normal_feet(const Eigen::Vector3d& origin, const Eigen::Vector3d& z,
                                     const PlacedAxis& axis);

/// From `origin` to where an axis that is not perpendicular to `z` meets the plane across `z`
/// through it, m.
[[nodiscard]] Eigen::Vector3d in_plane_across(const Eigen::Vector3d& origin,
                                              const Eigen::Vector3d& z, const PlacedAxis& axis);

/// From one direction to another about z, rad in (-pi, pi].
[[nodiscard]] double angle_about(const Eigen::Vector3d& z, const Eigen::Vector3d& from,
                                 const Eigen::Vector3d& to);

}  // namespace kinescope
