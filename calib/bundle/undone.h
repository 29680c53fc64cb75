// SPDX-License-Identifier: Apache-2.0
//
// Takes   a robot calibrated with effects, and the pose tracks or corners it was found from.
// Gives   them as the robot without those effects would have made them: what the search for the
//         structure is asked again on.
// Method  what each sighting leaves of the model with its effects, put onto the model without them.
#pragma once

#include "calib/bundle/calibration.h"
#include "calib/camera/marker_set.h"
#include "calib/camera/tag_observations.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// Sightings that the calibration left out, of which it says nothing, are left out here; those of
/// markers that are not on its robot stay as they are.
[[nodiscard]] PoseTracks with_effects_undone(const Calibration& calibration, PoseTracks tracks);

/// The same of corners, as the camera of the calibration would have seen them. What a pose leaves
/// open depends on how far the marker is turned from the line of sight, so tracks are made anew.
[[nodiscard]] TagObservations with_effects_undone(const Calibration& calibration,
                                                  const MarkerSet& markers, TagObservations tags);

}  // namespace kinescope
