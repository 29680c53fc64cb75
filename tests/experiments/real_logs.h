// SPDX-License-Identifier: Apache-2.0
//
// Measured torque logs of others as their files have them.
#pragma once

#include <filesystem>
#include <string>

#include "dynamics/data/torque_log.h"
#include "kinematics/log/channel_table.h"

namespace kinescope {

/// Columns prefix1 to prefix<count>.
[[nodiscard]] Eigen::MatrixXd columns(const ChannelTable& table, const std::string& prefix,
                                      int count);

/// A log as its file has it: t, q, dq and torque columns.
[[nodiscard]] TorqueLog read_log(const std::filesystem::path& path, int joints,
                                 const std::string& torque);

}  // namespace kinescope
