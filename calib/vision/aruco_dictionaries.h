// SPDX-License-Identifier: Apache-2.0
//
// OpenCV's dictionaries of ArUco markers by name. Internal to this room (shows OpenCV's types).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <opencv2/aruco.hpp>

namespace kinescope {

[[nodiscard]] std::vector<std::string> aruco_dictionary_names();
/// Null for a name that is none.
[[nodiscard]] cv::Ptr<cv::aruco::Dictionary> aruco_dictionary(std::string_view name);

}  // namespace kinescope
