// SPDX-License-Identifier: Apache-2.0
//
// What is declared about the markers: family, sizes, and the places of their corners.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/core/ids.h"

namespace kinescope {

/// Corners of a square tag in its own frame (x right, y down, z into the tag), in the order of the
/// AprilTag library: left bottom, right bottom, right top, left top as seen upright in front.
[[nodiscard]] inline std::vector<Eigen::Vector3d> square_corners(double size_m) {
  const double s = 0.5 * size_m;
  return {{-s, s, 0.0}, {s, s, 0.0}, {s, -s, 0.0}, {-s, -s, 0.0}};
}

/// tags.yaml as a value.
struct MarkerSet {
  std::string family =
      "tag36h11";               ///< AprilTag family, or an OpenCV dictionary such as DICT_6X6_250
  double default_size_m = 0.0;  ///< 0: only the ids in `sizes_m` are known
  std::map<TagId, double> sizes_m;  ///< edge of the black square where it is not the default
  bool only_listed = false;         ///< true: ids that are not in `sizes_m` are ghosts
  /// Flat targets with other corners than a square's (a chessboard as one marker), by id.
  std::map<TagId, std::vector<Eigen::Vector3d>> boards;

  /// Edge of the marker, 0 when nothing is declared for it.
  [[nodiscard]] double size_m(TagId id) const {
    const auto found = sizes_m.find(id);
    return found == sizes_m.end() ? default_size_m : found->second;
  }
  /// Places of the corners in the marker's frame, m.
  [[nodiscard]] std::vector<Eigen::Vector3d> corners_m(TagId id) const {
    const auto found = boards.find(id);
    return found == boards.end() ? square_corners(size_m(id)) : found->second;
  }
};

}  // namespace kinescope
