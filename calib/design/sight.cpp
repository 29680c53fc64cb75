// SPDX-License-Identifier: Apache-2.0
#include "calib/design/sight.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/camera/marker_set.h"

namespace kinescope::design {
namespace {

// A marker's white border as a share of its black square's edge: one cell of eight, the widest of
// the families that are read.
constexpr double kBorder = 0.125;

// In the image, in front of the camera.
std::vector<Eigen::Vector2d> projected_square(const CameraModel& camera,
                                              const Pose& T_camera_marker, double size_m) {
  std::vector<Eigen::Vector2d> out;
  for (const Eigen::Vector3d& corner : square_corners(size_m)) {
    const auto pixel = project(camera, T_camera_marker * corner);
    if (pixel) out.push_back(*pixel);
  }
  return out;
}

bool is_inside(const CameraModel& camera, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() <= camera.width - 1.0 &&
         pixel.y() <= camera.height - 1.0;
}

}  // namespace

double tilt_of(const Pose& T_camera_marker) {
  // A tag's z points into it.
  const double cosine =
      T_camera_marker.matrix3().col(2).dot(T_camera_marker.translation.normalized());
  return std::acos(std::clamp(cosine, -1.0, 1.0));
}

double shortest_edge_px(const std::vector<Eigen::Vector2d>& corners_px) {
  double out = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < corners_px.size(); ++i)
    out = std::min(out, (corners_px[(i + 1) % corners_px.size()] - corners_px[i]).norm());
  return out;
}

std::vector<TagObservation> expected_sightings(const Calibration& calibration,
                                               const Eigen::VectorXd& values,
                                               const SightLimits& limits,
                                               const MarkerNoise& noise) {
  const std::vector<Pose> T_base_link = forward_kinematics(calibration.tree, values);
  std::vector<TagObservation> out;
  for (const Marker& marker : calibration.tree.markers) {
    if (!(marker.size_m > 0.0)) continue;
    const Pose T_camera_marker =
        calibration.T_camera_base * T_base_link[marker.link.index()] * marker.T_link_marker;
    if (tilt_of(T_camera_marker) > limits.most_tilt_rad) continue;
    const double with_border = (1.0 + 2.0 * kBorder) * marker.size_m;
    const auto border = projected_square(calibration.camera, T_camera_marker, with_border);
    const bool inside = border.size() == 4 && std::ranges::all_of(border, [&](const auto& pixel) {
                          return is_inside(calibration.camera, pixel);
                        });
    if (!inside) continue;
    TagObservation seen;
    seen.id = marker.id;
    seen.corners_px = projected_square(calibration.camera, T_camera_marker, marker.size_m);
    seen.sigma_px = noise.of(marker.id);
    if (shortest_edge_px(seen.corners_px) >= limits.least_edge_px) out.push_back(std::move(seen));
  }
  return out;
}

}  // namespace kinescope::design
