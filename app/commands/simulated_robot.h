// SPDX-License-Identifier: Apache-2.0
//
// What the commands that simulate a robot begin and end with: a trajectory as a motion, the robot
// with its effects, the log that it writes.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/commands/console.h"
#include "app/torque/torque_inputs.h"
#include "dynamics/effects/trace_torque.h"

namespace kinescope {

/// The trajectory as a smooth motion in even steps of 1 / rate, without torques; the console is
/// warned. Throws bad_input: columns that are no joints, units that cannot be, too few rows.
[[nodiscard]] TorqueSamples reference_motion(const std::filesystem::path& trajectory,
                                             const TorqueRobot& robot, double rate_hz,
                                             const Console& console);

/// The robot with the effects of a file (app/io/torque_effects_file.h); none: as it is. Of a trace
/// beside its robot_traced.urdf, only what that lacks is added. Viscous and Coulomb friction of the
/// file take the place of the URDF's at their joint, of which the console is warned. Throws
/// bad_input for an effect that is none of this robot's.
[[nodiscard]] CorrectedTorqueModel simulated_robot(
    const std::filesystem::path& urdf, const DynamicModel& robot,
    const std::optional<std::filesystem::path>& effects, const TorqueSamples& motion,
    const Console& console);

/// Throws bad_input where no link has a mass.
void require_masses(const std::filesystem::path& urdf, const DynamicModel& robot);

/// t, then of every joint position, velocity and torque.
[[nodiscard]] std::string torque_log_csv(const TorqueSamples& samples,
                                         const std::vector<std::string>& joints);

}  // namespace kinescope
