// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibrated robot, and pose tracks with both planar branches.
// Gives   the same tracks with the branch first that the robot shows.
#pragma once

#include "calib/bundle/calibration.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// Of the two poses that one view of a flat marker allows, the one whose orientation is nearer to
/// where the robot has the marker. Sightings of markers that are not on the robot, and of frames
/// without joint values, stay as they are; so do all where the calibration did not converge.
[[nodiscard]] PoseTracks with_branches_of(const Calibration& calibration, PoseTracks tracks);

}  // namespace kinescope
