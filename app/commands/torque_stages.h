// SPDX-License-Identifier: Apache-2.0
//
// What `run` does with the torques of a recording.
#pragma once

#include <string>
#include <vector>

#include "app/commands/commands.h"
#include "calib/bundle/calibration.h"

namespace kinescope {

struct TorqueStages {
  std::vector<std::string> words = {};     ///< what was found, or why not, in sentences
  std::vector<std::string> products = {};  ///< names of the files that were written
};

/// Where the recording's joint log has torques: model_torque() and find_contacts() into the run's
/// folder, with the robot that was learned. Empty without torques.
[[nodiscard]] TorqueStages torque_stages(const Recording& recording, const RunOptions& options,
                                         const Calibration& calibration,
                                         const std::filesystem::path& folder,
                                         const Progress& progress);

}  // namespace kinescope
