// SPDX-License-Identifier: Apache-2.0
//
// Takes   corners of flat markers of known shape, in many views.
// Gives   a camera that nobody declared: focal length, principal point, two terms of distortion.
// Method  every view has a pose of its own, whatever carries the marker: bundle adjustment of
//         intrinsics and poses (Zhang 2000, section 3.3), from focal_from_tags. Two cameras are
//         compared by Student's t about what the best pose of each view leaves.
// Not here: the robot, whose motion says more of the camera (calib/bundle).
#pragma once

#include "calib/camera/camera_model.h"
#include "calib/camera/marker_set.h"
#include "calib/camera/tag_observations.h"

namespace kinescope {

/// Throws as focal_from_tags. Square pixels; a principal point within a few per cent of the
/// middle of the image.
[[nodiscard]] CameraModel camera_from_tags(const TagObservations& observations,
                                           const MarkerSet& markers);

/// ln of the odds that the markers' images, each view with a pose of its own, give one camera
/// against another: whatever carries the markers, and however large they are. Views are taken as
/// independent, which errors of the detector are not. 0 where no view can be told.
[[nodiscard]] double log_odds_of_shapes(const CameraModel& of, const CameraModel& against,
                                        const TagObservations& observations,
                                        const MarkerSet& markers);

}  // namespace kinescope
