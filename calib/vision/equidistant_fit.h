// SPDX-License-Identifier: Apache-2.0
//
// Takes   views of a board: pixels and places.
// Gives   the intrinsics of an equidistant lens (Kannala and Brandt 2006).
// Method  a start by search over the focal length, then lens and poses together (Ceres).
#pragma once

#include <optional>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/vision/board_points.h"

namespace kinescope {

/// fx, fy, cx, cy and k1 to k4 of an image of `width` x `height` px. cv::fisheye::calibrate
/// converges only from a focal length near the true one, which nobody declares. Nothing where no
/// focal length explains half of the views. Views with corners 90 degrees or more off the optical
/// axis are left out.
[[nodiscard]] std::optional<CameraModel> estimate_equidistant(const std::vector<BoardSight>& views,
                                                              int width, int height);

}  // namespace kinescope
