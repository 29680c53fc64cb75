// SPDX-License-Identifier: Apache-2.0
//
// Measured torque logs of others as their files have them, and arms from published tables.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "dynamics/data/torque_log.h"
#include "kinematics/log/channel_table.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// Columns prefix1 to prefix<count>.
[[nodiscard]] Eigen::MatrixXd columns(const ChannelTable& table, const std::string& prefix,
                                      int count);

/// A log as its file has it: t, q, dq and torque columns.
[[nodiscard]] TorqueLog read_log(const std::filesystem::path& path, int joints,
                                 const std::string& torque);

/// A serial arm by modified Denavit-Hartenberg rows (a, alpha, d), Craig's convention, no masses.
[[nodiscard]] DynamicModel dh_arm(const std::vector<std::array<double, 3>>& rows);

}  // namespace kinescope
