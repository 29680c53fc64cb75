// SPDX-License-Identifier: Apache-2.0
//
// Takes   views of a board: pixels and places.
// Gives   intrinsics, each view's pose and residual, the covariance of the intrinsics.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "calib/camera/camera_model.h"
#include "calib/vision/board.h"
#include "calib/vision/board_points.h"
#include "kinematics/core/pose.h"

namespace kinescope {

/// Intrinsics by cv::calibrateCamera (Zhang 2000), those of an equidistant lens by
/// estimate_equidistant(). Nothing where the estimation fails.
[[nodiscard]] std::optional<CameraModel> estimate_intrinsics(const std::vector<BoardSight>& views,
                                                             int width, int height,
                                                             const BoardOptions& options);

struct ViewFit {
  Pose T_camera_board;
  std::vector<Eigen::Vector2d> residuals_px;
  double rms_px = 0.0;
};

/// Pose of one board by Gauss-Newton on pixels, intrinsics held. Nothing when it has no start.
[[nodiscard]] std::optional<ViewFit> fit_view(const CameraModel& camera, const BoardSight& view);

/// Which of the intrinsics (fx fy cx cy, distortion) the fit estimates.
[[nodiscard]] std::vector<int> free_intrinsics(const BoardOptions& options);

/// Covariance of the free intrinsics, poses marginalised, with the noise of the residuals. Nothing
/// where the views do not determine them.
[[nodiscard]] std::optional<Eigen::MatrixXd> intrinsic_covariance(
    const CameraModel& camera, const std::vector<BoardSight>& views,
    const std::vector<ViewFit>& fits, const std::vector<int>& free);

}  // namespace kinescope
