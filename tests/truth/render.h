// SPDX-License-Identifier: Apache-2.0
//
// Pictures of markers whose corners are known exactly: every pixel is the integral of the sharp
// scene over the pixel and a Gaussian blur, then noise and rounding. Independent of calib/vision:
// markers are drawn from the libraries' own pictures of them.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/vision/image_view.h"
#include "kinematics/core/pose.h"
#include "kinematics/core/rng.h"

namespace kinescope {

/// A marker as printed, upright, with its white margin.
struct MarkerArt {
  int total_cells = 0;      ///< cells across, margin included
  int border_cells = 0;     ///< cells between the corners
  std::vector<bool> white;  ///< row by row from the top left

  [[nodiscard]] bool at(int column, int row) const {
    return white[static_cast<std::size_t>(row * total_cells + column)];
  }
};

[[nodiscard]] MarkerArt apriltag_art(const std::string& family, int id);
/// `dictionary` as OpenCV numbers them (cv::aruco::DICT_..).
[[nodiscard]] MarkerArt aruco_art(int dictionary, int id);

struct PlacedMarker {
  MarkerArt art;
  Pose T_camera_tag;
  double size_m = 0.05;  ///< between the corners
};

/// What camera and light do. Grey levels 0 to 255, lengths in px.
struct ImageOptions {
  double black = 25.0;
  double white = 225.0;
  double background = 120.0;
  double blur_px = 0.7;  ///< standard deviation, without the pixel's own integration
  double noise = 2.0;    ///< standard deviation
  int supersample = 12;  ///< in each direction
  Eigen::Vector2d motion_px = Eigen::Vector2d::Zero();  ///< while the shutter is open
  double gamma = 1.0;       ///< grey = 255 (light / 255)^(1 / gamma), after the blur
  double vignetting = 0.0;  ///< share of the light that the image's corners lack
};

/// Markers must not cover one another.
[[nodiscard]] GreyImage render_markers(const CameraModel& camera,
                                       const std::vector<PlacedMarker>& markers,
                                       const ImageOptions& options, Rng& rng);

/// Pixels of the corners in the middle of the exposure: left bottom, right bottom, right top, left
/// top.
[[nodiscard]] std::array<Eigen::Vector2d, 4> true_corners(const CameraModel& camera,
                                                          const PlacedMarker& marker);

/// A pose that shows the marker about `side_px` large, tilted by `tilt` about a direction in its
/// plane, turned by `turn` (rad), with its centre at `pixel`. The side is that of the untilted
/// marker.
[[nodiscard]] Pose pose_showing(const CameraModel& camera, const Eigen::Vector2d& pixel,
                                double side_px, double size_m, double tilt, double tilt_direction,
                                double turn);

}  // namespace kinescope
