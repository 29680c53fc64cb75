// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibrated robot before its camera, a posture.
// Gives   the markers that would be found there, and their corners.
// Not here: what the robot hides of itself; nobody declared its shape.
#pragma once

#include <map>
#include <set>
#include <vector>

#include "calib/bundle/calibration.h"
#include "calib/camera/tag_observations.h"

namespace kinescope::design {

/// How a marker must stand to be found.
struct SightLimits {
  double least_edge_px = kLeastEdge_px;  ///< its shortest edge is no shorter
  /// Between its normal and the line of sight (tilt_of): the detector's own least ratio of edges.
  double most_tilt_rad = 1.42;
};

/// What is expected of one marker's corners.
struct MarkerNoise {
  double all_px = 0.1;                ///< standard deviation of a coordinate
  std::map<TagId, double> of_marker;  ///< where it is known by itself
  /// Those that rest and err by the same in all frames: together one sighting, of `all_px`.
  std::set<TagId> at_rest;
  [[nodiscard]] double of(TagId id) const {
    const auto found = of_marker.find(id);
    return found == of_marker.end() ? all_px : found->second;
  }
};

/// Between a marker's normal and the line of sight to its middle, rad: 0 seen from the front, pi/2
/// edge on, more from behind.
[[nodiscard]] double tilt_of(const Pose& T_camera_marker);

/// Length of the shortest edge, px.
[[nodiscard]] double shortest_edge_px(const std::vector<Eigen::Vector2d>& corners_px);

/// The markers of a known size that are found with all joints at `values`, without noise: whole
/// within the image with their white border, large and frontal enough.
[[nodiscard]] std::vector<TagObservation> expected_sightings(const Calibration& calibration,
                                                             const Eigen::VectorXd& values,
                                                             const SightLimits& limits,
                                                             const MarkerNoise& noise);

}  // namespace kinescope::design
