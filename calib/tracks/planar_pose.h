// SPDX-License-Identifier: Apache-2.0
//
// Takes   the corners of one flat marker, its geometry and the camera.
// Gives   its pose, both planar branches with their reprojection costs, and the covariance.
// Method  homography, IPPE (Collins and Bartoli, IJCV 2014), Gauss-Newton on the corners from each
// branch.
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "calib/camera/camera_model.h"
#include "kinematics/core/pose.h"

namespace kinescope {

struct PlanarBranch {
  Pose T_camera_marker;
  double chi_square = 0.0;                     ///< sum of squared residuals / sigma^2
  Matrix6d covariance = Matrix6d::Identity();  ///< of a right perturbation
};

struct PlanarPose {
  PlanarBranch best;
  std::optional<PlanarBranch> other;  ///< the mirrored branch, where it is another pose
};

/// Nothing when the corners are degenerate (no homography, behind the camera, outside the lens
/// model).
[[nodiscard]] std::optional<PlanarPose> estimate_planar_pose(
    const CameraModel& camera, std::span<const Eigen::Vector3d> corners_m,
    std::span<const Eigen::Vector2d> corners_px, double sigma_px);

/// What the corners say of a pose that is nearly known, linearised about that: errors of the
/// corners are errors of the pose in proportion, which the best fit's of a small marker are not.
/// Nothing where they do not determine a pose.
[[nodiscard]] std::optional<PlanarBranch> pose_about(const CameraModel& camera,
                                                     std::span<const Eigen::Vector3d> corners_m,
                                                     std::span<const Eigen::Vector2d> corners_px,
                                                     double sigma_px, const Pose& T_camera_marker);

}  // namespace kinescope
