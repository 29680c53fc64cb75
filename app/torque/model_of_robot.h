// SPDX-License-Identifier: Apache-2.0
//
// Whether a saved torque model is of the robot that it is used with.
#pragma once

#include <filesystem>

#include "dynamics/models/torque_predictor.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// Throws bad_input, with the model's file, where names or places of joints, or the name of the
/// robot, are others than in the URDF.
void require_model_of(const std::filesystem::path& file, const SavedTorqueModel& model,
                      const DynamicModel& robot, const std::filesystem::path& urdf);

}  // namespace kinescope
