// SPDX-License-Identifier: Apache-2.0
//
// A joint log from a table that was read, for those who need the table's other columns, too.
#pragma once

#include <string>
#include <vector>

#include "kinematics/core/csv.h"
#include "kinematics/log/joint_log.h"

namespace kinescope {

/// A joint log and the row of the table that each of its samples comes from.
struct TableLog {
  JointLog log;
  std::vector<std::size_t> rows;
};

/// As read_joint_log(), from the table or a part of its columns.
[[nodiscard]] TableLog joint_log_of(CsvTable table,
                                    const std::vector<std::string>& torque_channels = {});
/// The table's column of the stamps, with a unit in its name or without. Throws bad_input.
[[nodiscard]] std::size_t time_column(const CsvTable& table);

}  // namespace kinescope
