// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/seen_tag.h"

namespace kinescope::truth {
namespace {

constexpr double kSeenFromBehind = 0.25;  // cosine of the view beyond which no tag is found

}  // namespace

std::optional<TagObservation> seen_tag(const World& world, const Marker& marker,
                                       const Pose& T_camera_marker, double sigma_px, Rng& rng) {
  const Eigen::Vector3d normal = T_camera_marker.rotation * Eigen::Vector3d::UnitZ();
  if (normal.dot(T_camera_marker.translation.normalized()) < kSeenFromBehind) return std::nullopt;
  TagObservation out;
  out.id = marker.id;
  constexpr double kDeclared_px = 0.1;  // of exact corners
  out.sigma_px = sigma_px > 0.0 ? sigma_px : kDeclared_px;
  for (const Eigen::Vector3d& corner : world.markers.corners_m(marker.id)) {
    const auto pixel = project(world.camera, T_camera_marker * corner);
    if (!pixel || pixel->x() < 0.0 || pixel->y() < 0.0 || pixel->x() > world.camera.width - 1.0 ||
        pixel->y() > world.camera.height - 1.0)
      return std::nullopt;
    out.corners_px.emplace_back(pixel->x() + rng.normal(sigma_px),
                                pixel->y() + rng.normal(sigma_px));
  }
  return out;
}

}  // namespace kinescope::truth
