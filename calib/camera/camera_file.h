// SPDX-License-Identifier: Apache-2.0
//
// Intrinsics files. Read: ROS camera_info YAML, Kalibr camchain YAML (pinhole radtan / equi),
// OpenCV FileStorage YAML or XML. Written: ROS camera_info.
#pragma once

#include <filesystem>
#include <string>

#include "calib/camera/camera_model.h"

namespace kinescope {

/// Throws bad_input naming file, key and remedy: not YAML/XML, a missing key, a model we do not
/// know, a wrong number of distortion terms, sizes or focal lengths that are not positive, NaN;
/// focal lengths that fit no lens for the image (mm), distortion that folds it over itself. Files
/// without an image size (OpenCV) give width = height = 0 only when `image_width` is nowhere to be
/// found.
[[nodiscard]] CameraModel read_camera(const std::filesystem::path& path);

/// The same from text; `source` stands for the file in messages.
[[nodiscard]] CameraModel parse_camera(const std::string& text, const std::string& source);

/// Throws bad_input when the image size differs from the camera's; a camera without a size takes
/// this one.
[[nodiscard]] CameraModel with_image_size(CameraModel camera, int width, int height,
                                          const std::string& source);

/// ROS camera_info text.
[[nodiscard]] std::string write_camera_info(const CameraModel& camera);

}  // namespace kinescope
