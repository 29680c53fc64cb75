// SPDX-License-Identifier: Apache-2.0
//
// What a camera's file and a table of corners cannot be: found by looking at them alone, before
// anything is fitted, which would come out sound and be of another robot.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/camera/marker_set.h"
#include "calib/camera/tag_observations.h"

namespace kinescope {

/// Where nearly all square markers are seen from behind, through the paper, their corners are
/// turned to AprilTag's order, and a warning says so: OpenCV's order is told from v counted upward,
/// which mirrors the robot, by no table alone. So are those of single markers that go round another
/// way than the others.
void turn_clockwise_corners(TagObservations& corners, const MarkerSet& markers,
                            const std::filesystem::path& file, std::vector<std::string>& warnings);

/// One sentence where the principal point is far from the middle of the images: they are of another
/// size, or cx and cy are exchanged. Images that were cut out of others have such a point, too.
void warn_of_principal_point(const CameraModel& camera, const std::filesystem::path& file,
                             std::vector<std::string>& warnings);

}  // namespace kinescope
