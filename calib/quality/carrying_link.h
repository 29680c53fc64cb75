// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibrated robot, and the poses of a marker that it does not have.
// Gives   the links in whose frames the marker moves least, and where it is there.
// Method  medians of places: those of a marker that is bent or slips are nearly right, while its
//         turns may be anything.
#pragma once

#include <vector>

#include "calib/bundle/calibration.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// On one link after the other, by how little it moves there; without a size. Empty where no sample
/// has a frame whose joint values are known.
[[nodiscard]] std::vector<Marker> on_carrying_links(const Calibration& robot,
                                                    const PoseTrack& marker);

}  // namespace kinescope
