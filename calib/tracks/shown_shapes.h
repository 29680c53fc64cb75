// SPDX-License-Identifier: Apache-2.0
//
// Takes   corners of square markers in many views, and the camera.
// Gives   the shape that each marker's images show, and how much better it tells them than a flat
//         square does; the scale of the corners' noise.
// Method  every view has a pose of its own, whatever carries the marker. What no pose takes is
//         linear in the shape: variable projection (Golub and Pereyra 1973), views weighted as
//         Student's t has them.
// Not here: a marker's size, which no view tells apart from its distance.
#pragma once

#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/camera/marker_set.h"
#include "calib/camera/marker_shape.h"
#include "calib/camera/tag_observations.h"

namespace kinescope {

struct ShownShape {
  TagId id;
  MarkerShape shape;
  double log_odds = 0.0;  ///< against a flat square, the three numbers of the shape paid for
};

/// Of every square marker that is seen often enough to tell, by id. Views are taken as independent,
/// which errors of the detector are not.
[[nodiscard]] std::vector<ShownShape> shown_shapes(const CameraModel& camera,
                                                   const TagObservations& observations,
                                                   const MarkerSet& markers);

/// Student's scale of a corner's coordinate, px, by what the best pose of each view leaves (of
/// normal noise 0.8 of its standard deviation); 0 where there is no view of a square.
[[nodiscard]] double scale_of_shapes(const CameraModel& camera, const TagObservations& observations,
                                     const MarkerSet& markers);

}  // namespace kinescope
