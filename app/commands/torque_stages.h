// SPDX-License-Identifier: Apache-2.0
//
// The commands that work on a torque log, without their words: for the program and for `run`.
#pragma once

#include <string>
#include <vector>

#include "app/commands/commands.h"
#include "app/report/contact_summary.h"
#include "app/report/torque_summary.h"

namespace kinescope {

/// Writes dynamics.json, robot_dynamics.urdf and dynamics.html.
[[nodiscard]] TorqueSummary model_torque(const DynamicsOptions& options, const Progress& progress);

/// Writes contacts.csv, contacts.json and contact.html.
[[nodiscard]] ContactSummary find_contacts(const ContactCommandOptions& options);

/// Where the recording's joint log has torques: both of the above into the run's folder, with the
/// robot that was learned. Gives what was found in sentences, and the reason where it could not be
/// done; empty without torques.
[[nodiscard]] std::vector<std::string> torque_stages(const Recording& recording,
                                                     const RunOptions& options,
                                                     const KinematicTree& tree,
                                                     const std::filesystem::path& folder,
                                                     const Progress& progress);

}  // namespace kinescope
