// SPDX-License-Identifier: Apache-2.0
//
// Takes   a recording whose camera may move: with a link of the robot, or in a person's hand.
// Gives   how it moves, declared (`camera_mount`) or found out; the structure from the robot's
// base;
//         the start of a calibration.
// Method  One that a person carries: no marker stands still in its frame, and with the camera taken
//         as fixed there is no robot, but seen from markers that keep their places among one
//         another there is. One on the robot: where all that is seen is one body, no measurement
//         parts it from a fixed camera before the robot's hand; the order of the log's columns may.
#pragma once

#include <string>
#include <vector>

#include "app/explain/pipeline.h"

namespace kinescope {

/// Sets `camera_mount`, and `fixed_tags` of a camera that is carried, where they are not declared
/// and the recording shows them; gives what to say of it, empty where there is nothing. Throws
/// bad_input where a camera that moves is declared beside what needs one at rest, undetermined
/// where its markers do not show it.
[[nodiscard]] std::string settle_camera(const Observed& observed, const PoseTracks& tracks,
                                        const CalibrateOptions& options, Recording& recording);

/// On the robot or carried, as settle_camera() left it.
[[nodiscard]] bool moves_camera(const Recording& recording);

/// find_structure() of tracks in the camera's frame, from what stands still in the world.
[[nodiscard]] Structure structure_from_base(const Recording& recording, const PoseTracks& tracks,
                                            const StructureOptions& options);

/// Where a camera that moves is, beside a start in whose tree the structure is.
void add_moving_camera(const Recording& recording, const Structure& structure,
                       const PoseTracks& tracks, CalibrationStart& start);

/// The same of a nominal robot, whose base, markers and camera are to be placed; `values`: frames x
/// joints, rad or m.
void place_moving_camera(const Recording& recording, const PoseTracks& tracks,
                         const Eigen::MatrixXd& values, CalibrationStart& start);

/// The recording whose tracks are as if the camera stood still: what is asked of markers alone.
[[nodiscard]] PoseTracks as_of_fixed_camera(const Recording& recording, const PoseTracks& tracks);

}  // namespace kinescope
