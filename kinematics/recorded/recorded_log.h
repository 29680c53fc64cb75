// SPDX-License-Identifier: Apache-2.0
//
// Takes   a log's path: a table (CSV, also packed with gzip), a MAT-file, a bag, a LeRobot dataset.
// Gives   the log.
// Units   t in s; values as recorded.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "kinematics/core/csv.h"
#include "kinematics/log/channel_table.h"
#include "kinematics/log/joint_log.h"

namespace kinescope::recorded {

/// The table of a joint log, and what was wrong with what it is from.
struct LogTable {
  CsvTable table;  ///< of a bag or dataset: or MAT-file: lines the rows, from 1
  std::vector<std::string> warnings;
  std::vector<double> joined_at_s;  ///< as JointLog's
};

/// `keep`: columns that stay though no joint's position (torques that were declared). Throws as
/// read_csv(), mat::joint_table(), bags::joint_table() and datasets::read_signals().
[[nodiscard]] LogTable read_log_table(const std::filesystem::path& path,
                                      const std::vector<std::string>& keep = {});
/// As kinescope::read_joint_log(), also from a bag or dataset.
[[nodiscard]] JointLog read_joint_log(const std::filesystem::path& path,
                                      const std::vector<std::string>& torque_channels = {});

/// As kinescope::read_channel_table(), also from a bag or dataset.
[[nodiscard]] ChannelTable read_channel_table(const std::filesystem::path& path);
[[nodiscard]] std::vector<ChannelTable> read_channel_tables(
    const std::vector<std::filesystem::path>& paths);

/// The columns of a torque log that hold a channel of the joint log and its torque.
struct TorqueColumns {
  std::string position, torque;
};
[[nodiscard]] TorqueColumns torque_columns(const std::filesystem::path& log,
                                           const std::string& channel, const std::string& torque);

}  // namespace kinescope::recorded
