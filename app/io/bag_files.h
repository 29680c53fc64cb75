// SPDX-License-Identifier: Apache-2.0
//
// What a recording's other files say, from a bag: the camera, the corners of markers.
#pragma once

#include <optional>

#include "calib/camera/camera_model.h"
#include "kinematics/bags/bag.h"
#include "kinematics/core/csv.h"

namespace kinescope {

/// The camera whose images `source` names, from its CameraInfo: of the image as the driver
/// publishes it (cut out, binned, rectified). Nothing where none is published or calibrated.
/// Throws bad_input as read_camera() does for what no lens is.
[[nodiscard]] std::optional<CameraModel> camera_of_bag(const bags::Source& source);

/// corners.csv, from the bag's detections of markers of a family. Throws bad_input: none of them.
[[nodiscard]] CsvTable corners_of_bag(const bags::Source& source, const std::string& family);

}  // namespace kinescope
