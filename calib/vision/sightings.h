// SPDX-License-Identifier: Apache-2.0
//
// Takes   every detection of a recording.
// Gives   those that are believed, and the others with the reason: ids nobody declared, impossible
// shapes, two
//         of one id in a frame, jumps away and back, ids seen too rarely.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/camera/marker_set.h"
#include "calib/camera/tag_observations.h"

namespace kinescope {

/// Sightings this close in time, s, say where a marker is.
inline constexpr double kNearby_s = 0.25;

/// Moves what is not believed from `observations.observations` to `observations.rejected` and sorts
/// both. Returns warnings for the user, one line each.
[[nodiscard]] std::vector<std::string> sort_out_sightings(TagObservations& observations,
                                                          const MarkerSet& markers,
                                                          int min_sightings);

/// The same with sightings whose corners could not be fitted, of markers of which nearly all could:
/// what hinders a fit moves the detector's corners by more than their usual error.
void put_unfitted_aside(TagObservations& observations);

/// Why a detection's shape cannot be a marker's picture; nothing when it can.
[[nodiscard]] std::optional<std::string> impossible_shape(
    const std::vector<Eigen::Vector2d>& corners_px);

/// Length of the mean edge, px.
[[nodiscard]] double mean_edge_px(const std::vector<Eigen::Vector2d>& corners_px);

/// Mean distance of corresponding corners, px.
[[nodiscard]] double corner_distance_px(const std::vector<Eigen::Vector2d>& a,
                                        const std::vector<Eigen::Vector2d>& b);

/// Are these two detections of one and the same marker, by where they are?
[[nodiscard]] bool is_same_place(const std::vector<Eigen::Vector2d>& a,
                                 const std::vector<Eigen::Vector2d>& b);

/// Corners between two sightings (or beyond them), linear in time.
[[nodiscard]] std::vector<Eigen::Vector2d> corners_between(const TagObservation& a, double time_a_s,
                                                           const TagObservation& b, double time_b_s,
                                                           double time_s);

}  // namespace kinescope
