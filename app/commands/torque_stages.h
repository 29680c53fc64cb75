// SPDX-License-Identifier: Apache-2.0
//
// The commands that work on a torque log, without their words: for the program and for `run`.
#pragma once

#include <string>
#include <vector>

#include "app/commands/commands.h"
#include "app/report/contact_summary.h"
#include "app/report/torque_summary.h"
#include "calib/bundle/calibration.h"

namespace kinescope {

/// Writes dynamics.json, robot_dynamics.urdf and dynamics.html.
[[nodiscard]] TorqueSummary model_torque(const DynamicsOptions& options, const Progress& progress);

/// Writes contacts.csv, contacts.json and contact.html.
[[nodiscard]] ContactSummary find_contacts(const ContactCommandOptions& options);

struct TorqueStages {
  std::vector<std::string> words = {};     ///< what was found, or why not, in sentences
  std::vector<std::string> products = {};  ///< names of the files that were written
};

/// Where the recording's joint log has torques: both of the above into the run's folder, with the
/// robot that was learned. Empty without torques.
[[nodiscard]] TorqueStages torque_stages(const Recording& recording, const RunOptions& options,
                                         const Calibration& calibration,
                                         const std::filesystem::path& folder,
                                         const Progress& progress);

}  // namespace kinescope
