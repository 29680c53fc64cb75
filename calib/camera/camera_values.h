// SPDX-License-Identifier: Apache-2.0
//
// Values of an intrinsics file, checked; what is wrong is named by file and key.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "calib/camera/camera_model.h"
#include "kinematics/core/error.h"

namespace kinescope::camera_file {

inline constexpr std::string_view kKnownFiles =
    "ROS camera_info, Kalibr camchain and OpenCV storage files are read";

/// The file, for messages: "file: key".
struct Source {
  std::string file;
  [[nodiscard]] Error bad(std::string_view key, std::string_view what,
                          std::string_view remedy) const;
};

[[nodiscard]] double to_number(const Source& source, const std::string& key,
                               const std::string& text);
[[nodiscard]] std::vector<double> to_numbers(const Source& source, const std::string& key,
                                             const YAML::Node& node);
/// Width or height of an image.
[[nodiscard]] int to_size(const Source& source, const std::string& key, const std::string& text);

/// The value of a key that has to be there.
[[nodiscard]] YAML::Node need(const Source& source, const YAML::Node& parent,
                              const std::string& key);

/// fx 0 cx 0 fy cy 0 0 1, row by row.
void set_matrix(const Source& source, const std::string& key, const std::vector<double>& m,
                CameraModel& camera);
/// Focal lengths above zero.
void check_values(const Source& source, const CameraModel& camera, std::string_view focal_key);

/// Distortion of the polynomial models by number of terms; more than eight only where the rest are
/// zero.
void set_polynomial(const Source& source, const std::string& key, std::vector<double> d,
                    DistortionModel model, CameraModel& camera);
void set_equidistant(const Source& source, const std::string& key, const std::vector<double>& d,
                     CameraModel& camera);

}  // namespace kinescope::camera_file
