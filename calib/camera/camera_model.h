// SPDX-License-Identifier: Apache-2.0
//
// Takes   points in the camera's frame (x right, y down, z forward), m.
// Gives   pixels, with the centre of the top-left pixel at (0, 0), and their derivatives; and back.
// Method  pinhole with the distortion models of ROS camera_info: plumb_bob (Brown 1966),
//         rational_polynomial, equidistant (Kannala and Brandt 2006), as OpenCV defines them.
// Not here: files (camera_file.h), estimation (calib/vision, calib/bundle).
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Core>

namespace kinescope {

enum class DistortionModel { kPlumbBob, kRationalPolynomial, kEquidistant };

[[nodiscard]] std::string_view to_string(DistortionModel model);

struct CameraModel {
  std::string name = "camera";
  int width = 0;                                  ///< px
  int height = 0;                                 ///< px
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;  ///< px
  DistortionModel model = DistortionModel::kPlumbBob;
  /// plumb_bob: k1 k2 p1 p2 k3; rational_polynomial: k1 k2 p1 p2 k3 k4 k5 k6; equidistant: k1 k2 k3
  /// k4.
  std::array<double, 8> distortion{};

  bool operator==(const CameraModel&) const = default;
};

/// Number of distortion terms the model uses.
[[nodiscard]] int distortion_count(DistortionModel model);

/// Number of intrinsic parameters in the order fx fy cx cy, then the distortion terms.
inline constexpr int kMaxIntrinsics = 12;

struct Projection {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> d_point;                    ///< px per m
  Eigen::Matrix<double, 2, kMaxIntrinsics> d_intrinsics;  ///< fx fy cx cy, then distortion
};

/// The pixel of a point, or nothing when it is not in front of the camera.
[[nodiscard]] std::optional<Eigen::Vector2d> project(const CameraModel& camera,
                                                     const Eigen::Vector3d& point_camera);
/// The same with derivatives.
[[nodiscard]] std::optional<Projection> project_with_derivatives(
    const CameraModel& camera, const Eigen::Vector3d& point_camera);

/// Normalised image coordinates (x/z, y/z) of a pixel: the distortion undone by Newton's method.
/// Nothing where the model cannot be inverted (outside its valid field).
[[nodiscard]] std::optional<Eigen::Vector2d> unproject(const CameraModel& camera,
                                                       const Eigen::Vector2d& pixel);

/// A start for a camera nobody declared: principal point in the middle, no distortion.
[[nodiscard]] CameraModel pinhole_guess(int width, int height, double focal_px);

}  // namespace kinescope
