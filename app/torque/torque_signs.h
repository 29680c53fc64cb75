// SPDX-License-Identifier: Apache-2.0
//
// Torques whose sign is not the model's, before anything is fitted.
#pragma once

#include <filesystem>
#include <vector>

#include "dynamics/data/torque_scale.h"
#include "dynamics/identify/identify.h"

namespace kinescope {

/// Throws bad_input with the torque_factor to declare where a joint's torque contradicts the other
/// joints' (dynamics/models/turned_torques.h), or most of them the inertia of the masses. What
/// nominal masses alone say about a sign (in `scales`) is no refusal any more where turning it
/// would contradict the other joints: a wrist that carries what its URDF lacks, say.
void check_torque_signs(const DynamicModel& model, const TorqueSamples& samples,
                        const IdentifyOptions& options,
                        const std::vector<std::filesystem::path>& logs, TorqueScales& scales);

}  // namespace kinescope
