// SPDX-License-Identifier: Apache-2.0
//
// Takes   the axes of a robot in one posture, as lines in any frame.
// Gives   the numbers of their arrangement that no choice of frames changes: distance, twist,
// offset
//         along an axis, angle between successive common normals.
// Frames  any, the same for all axes; m and rad.
// Method  common normals (Denavit and Hartenberg 1955). Successive axes that are nearly parallel
// have
//         none worth the name: there the plane across the first one takes its place (Hayati and
//         Mirmirani 1985), and where they are one line besides, its own two directions do. A joint
//         that slides has a direction, but no place.
// Not here: uncertainties (calib/quality/robot_difference.h).
#pragma once

#include <span>
#include <vector>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

struct PlacedAxis {
  JointType type = JointType::kRevolute;                 ///< revolute or prismatic
  Eigen::Vector3d point = Eigen::Vector3d::Zero();       ///< m, of the line; prismatic: any
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< unit
  int parent = -1;  ///< the axis before it, which stands earlier in the list; -1: the base
};

/// Axes with their points and directions where the joints have these values (one a joint, rad or
/// m): of joints that are not fixed, in the order of the tree; in the base frame. `joints` receives
/// which joint each axis is of.
[[nodiscard]] std::vector<PlacedAxis> placed_axes(const KinematicTree& tree,
                                                  const Eigen::VectorXd& values,
                                                  std::vector<JointId>& joints);

enum class AxisQuantityKind {
  kDistance,  ///< m, along the common normal; signed where the axes are not parallel
  kTwist,     ///< rad, about the common normal
  kOffset,    ///< m, along `axis`, from the normal before it to the one to `next`
  kAngle,     ///< rad, about `axis`, from the normal before it to the one to `next`
  kTilt,      ///< rad, of nearly parallel axes: towards each other, or (kTiltX, kTiltY) of one line
  kTiltX,
  kTiltY,
  kPlaceX,  ///< m, of `next` across `axis` where both are nearly one line
  kPlaceY
};

/// In m; else in rad.
[[nodiscard]] bool is_length(AxisQuantityKind kind);

struct AxisQuantity {
  AxisQuantityKind kind = AxisQuantityKind::kDistance;
  int axis = -1;
  int next = -1;  ///< the axis that it leads to
  [[nodiscard]] bool operator==(const AxisQuantity&) const = default;
};

/// How an axis is described from the one before it.
enum class AxisStep { kStart, kNormal, kParallel, kCoaxial };

/// Which formulas describe a robot: chosen on one calibration of it, used on all of them, so that
/// their numbers can be compared.
struct AxisLayout {
  std::vector<AxisStep> steps;  ///< beside the axes
  int first_line = -1;          ///< first axis that turns; -1: none
  int foot_towards = -1;        ///< the axis whose normal with it is the start; -1: none is
  int turn_towards = -1;        ///< the axis that fixes the start's direction; -1: none does
  bool turn_by_place = false;   ///< by where it is, as its direction is the first axis' own
  std::vector<AxisQuantity> quantities;  ///< those that no choice of frames changes
  std::vector<int> kept;                 ///< where each stands among all that the steps give
};

[[nodiscard]] AxisLayout axis_layout(std::span<const PlacedAxis> axes);

/// Beside layout.quantities. Angles are in (-pi, pi]: of differences take the remainder.
[[nodiscard]] Eigen::VectorXd axis_values(const AxisLayout& layout,
                                          std::span<const PlacedAxis> axes);

/// d value / d m by which the start slides along the first axis that turns: where all axes are
/// nearly parallel nothing says at which height their distances are meant. Zero elsewhere.
[[nodiscard]] Eigen::VectorXd axis_values_by_height(const AxisLayout& layout,
                                                    std::span<const PlacedAxis> axes);

}  // namespace kinescope
