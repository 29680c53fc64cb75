// SPDX-License-Identifier: Apache-2.0
//
// Takes   corners of a target in one view, a camera some of whose intrinsics are free, and a pose.
// Gives   a cost of Ceres: what the camera predicts less what it saw.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "calib/camera/camera_model.h"
#include "kinematics/core/pose.h"

namespace ceres {
class CostFunction;
}

namespace kinescope {

/// d (fx fy cx cy, distortion) / d (free numbers), constant: kMaxIntrinsics x n. A row of zeros
/// belongs to an intrinsic that is held.
using FreeIntrinsics = Eigen::Matrix<double, kMaxIntrinsics, Eigen::Dynamic>;

/// The camera at these numbers, n of them.
[[nodiscard]] CameraModel camera_at(CameraModel camera, const FreeIntrinsics& free,
                                    const double* numbers);
/// The numbers (n) under which a camera is what it is, where each intrinsic hangs on one of them.
[[nodiscard]] Eigen::VectorXd numbers_of(const CameraModel& camera, const FreeIntrinsics& free);

struct ViewOfTarget {
  std::vector<Eigen::Vector3d> places_m;   ///< in the target's frame
  std::vector<Eigen::Vector2d> pixels_px;  ///< beside them
  double sigma_px = 1.0;
  Pose T_camera_target;  ///< where the step is zero
};

/// Blocks: the free numbers (n), and a step (6: rad, m) of the pose, T_camera_target exp(step).
/// 2 rows a corner, in standard deviations. Fails where a corner has no image.
[[nodiscard]] std::unique_ptr<ceres::CostFunction> make_view_cost(const CameraModel& camera,
                                                                  const FreeIntrinsics& free,
                                                                  ViewOfTarget view);

}  // namespace kinescope
