// SPDX-License-Identifier: Apache-2.0
//
// Takes   TagObservations, the camera and the markers.
// Gives   PoseTracks with both planar branches; the branch that fits the neighbouring frames stands
// first. Method  estimate_planar_pose for each sighting; one factor for the corners' sigmas from
// all of them, where they fit worse than declared; dynamic programming over time; all views of a
// marker at rest taken as one.
#pragma once

#include "calib/camera/camera_model.h"
#include "calib/camera/marker_set.h"
#include "calib/camera/tag_observations.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

[[nodiscard]] PoseTracks pose_tracks_from_tags(const TagObservations& observations,
                                               const CameraModel& camera, const MarkerSet& markers);

/// Focal length (px) from the shapes of the markers' images alone, principal point in the middle of
/// the image: a start for a camera nobody declared. Zhang 2000, section 3.1. Throws undetermined
/// when all markers are seen face on.
[[nodiscard]] double focal_from_tags(const TagObservations& observations, const MarkerSet& markers);

}  // namespace kinescope
