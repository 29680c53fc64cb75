// SPDX-License-Identifier: Apache-2.0
//
// Takes   corners of flat markers of known shape, in many views.
// Gives   a camera that nobody declared: focal length, principal point, two terms of distortion.
// Method  every view has a pose of its own, whatever carries the marker: bundle adjustment of
//         intrinsics and poses (Zhang 2000, section 3.3), from focal_from_tags.
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

}  // namespace kinescope
