// SPDX-License-Identifier: Apache-2.0
//
// The formats of intrinsics files, one function each.
#pragma once

#include <string>

#include "calib/camera/camera_values.h"

namespace kinescope::camera_file {

/// camera_info of ROS.
[[nodiscard]] CameraModel read_ros(const Source& source, const YAML::Node& root);

/// One camera of a Kalibr camchain.
[[nodiscard]] CameraModel read_kalibr(const Source& source, const std::string& name,
                                      const YAML::Node& root);

/// OpenCV's FileStorage.
[[nodiscard]] CameraModel read_opencv_yaml(const Source& source, const YAML::Node& root);
[[nodiscard]] CameraModel read_opencv_xml(const Source& source, const std::string& text);

}  // namespace kinescope::camera_file
