// SPDX-License-Identifier: Apache-2.0
//
// Takes   several recordings of one robot: each with its own fixed camera, clock and noise.
// Gives   what all of them saw, one after the other on one clock, as if by as many cameras
//         (see_cameras.h): everything behind goes on as with those.
// Method  The structure is looked for in each recording alone; the one that explains all of them is
//         the reference. Where a camera stands the robot itself tells
//         (calib/bundle/place_recording.h). Which recordings are pieces of one, and which markers
//         were stuck on anew, is decided between plain fits of all recordings by how probable they
//         make postures that they have not seen (calib/quality/predictive_score.h).
// Not here: what differs between recordings by little; that is traced (calib/effects).
#pragma once

#include <functional>
#include <vector>

#include "app/explain/see_cameras.h"

namespace kinescope {

/// `given`: as read_recordings() gives several. Pieces of one recording give what that would.
/// Throws undetermined where no recording alone shows the robot, or one of them shows too little to
/// be placed; bad_request where some are of postures and some of motion.
[[nodiscard]] SeenTogether see_recordings(
    const std::vector<Recording>& given, const SightOptions& options,
    const std::function<SeenAlone(const Recording&)>& see_alone);

/// The structure with the markers that only other recordings than the reference show, each on the
/// link that carries it; unchanged where there are no other recordings.
[[nodiscard]] Structure with_further_markers(Structure structure, const Recording& recording,
                                             const Observed& observed, const PoseTracks& tracks,
                                             const CameraModel& camera);

/// Tracks in the reference camera's frame as the calibration has the cameras, in place of where
/// they were first put; unchanged where there are no other recordings.
[[nodiscard]] PoseTracks placed_again(PoseTracks tracks, const Observed& observed,
                                      const Calibration& calibration);

}  // namespace kinescope
