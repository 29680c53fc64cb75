// SPDX-License-Identifier: Apache-2.0
//
// What every command on a torque log begins with: the robot, the names of its parts, the inputs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/report/run_summary.h"
#include "dynamics/data/torque_scale.h"
#include "dynamics/rigid/rigid_model.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// A URDF with the gravity that was declared, and its movable joints in order.
struct TorqueRobot {
  DynamicModel model;
  std::vector<std::string> joints;
  std::vector<std::string> links;  ///< the one that each joint moves
  std::vector<JointType> types;
};

/// Throws what reading a URDF throws.
[[nodiscard]] TorqueRobot read_torque_robot(const std::filesystem::path& urdf,
                                            const std::optional<Eigen::Vector3d>& gravity_m_s2);

/// Some link has a mass.
[[nodiscard]] bool has_masses(const DynamicModel& model);

/// The torque of the logs against the masses of the robot: unit, sign, lag.
[[nodiscard]] TorqueScales torque_scales(const RigidModel& rigid, const TorqueSamples& samples,
                                         const std::vector<std::filesystem::path>& logs);

/// Findings without a place are everywhere in the logs.
void put_into_place(const std::vector<std::filesystem::path>& logs,
                    std::vector<LogFinding>& findings);

/// What is odd about a log and was worked around, and joints that the model does not have.
[[nodiscard]] std::vector<std::string> warnings_of(const std::vector<LogFinding>& findings);

/// "a.csv, b.csv": names of files without their folders.
[[nodiscard]] std::string file_list(const std::vector<std::filesystem::path>& files);

/// The files of all lists by name and content, in order.
[[nodiscard]] std::vector<InputFile> hashed_inputs(
    const std::vector<std::vector<std::filesystem::path>>& lists);

}  // namespace kinescope
