// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "app/commands/commands.h"

namespace kinescope {

/// `run` on a recording with a flange.csv: hand_eye.json, hand_eye.urdf and the report in place of
/// a robot. Throws undetermined before anything is written over.
[[nodiscard]] ExitCode run_hand_eye(const RunOptions& options, const Recording& recording,
                                    const Console& console);

}  // namespace kinescope
