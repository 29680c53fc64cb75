// SPDX-License-Identifier: Apache-2.0
//
// The recordings that the tables change: as they are, nothing of them is refused.
#pragma once

#include "tests/app/commands/lying_input/lying_case.h"
#include "tests/app/commands/poses_of_arm.h"

namespace kinescope::lying {

/// Three turning joints seen by a tracker.
[[nodiscard]] RandomRobot robot_of_poses();
[[nodiscard]] RobotRecording poses_of(const RecordingOptions& options);
[[nodiscard]] Files poses_files(const RecordingOptions& options = {});
[[nodiscard]] const Files& poses();

/// A tag at rest and one that goes round; what is refused is refused before any geometry.
[[nodiscard]] const Files& corners();

/// The arm of the poses as drawn, its joints named like the columns.
[[nodiscard]] const Files& nominal();

/// A robot of three joints, its torques, and the model learned from them.
[[nodiscard]] const Files& torques();

}  // namespace kinescope::lying
