// SPDX-License-Identifier: Apache-2.0
//
// Takes   a saved torque model and logs of its robot.
// Gives   the logs as samples that the model may be asked about: its joints, its low-pass, its
// unit. Units   as dynamics/data/torque_samples.h. Not here: what the model says of them
// (predict.cpp).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/io/torque_model_file.h"
#include "dynamics/data/torque_data.h"

namespace kinescope {

/// What a settings file says of a log (the one named, or recording.yaml beside the log), `words` of
/// the command line first. Throws what read_dynamics_settings() throws.
[[nodiscard]] TorqueDataOptions log_settings(const std::optional<std::filesystem::path>& settings,
                                             const std::filesystem::path& log,
                                             const TorqueDataOptions& words);

/// Throws bad_input for torques in another unit than the model's, and what reading throws.
[[nodiscard]] TorqueData read_log_for(const TorqueModelFile& file,
                                      const std::vector<std::filesystem::path>& logs,
                                      TorqueDataOptions data);

}  // namespace kinescope
