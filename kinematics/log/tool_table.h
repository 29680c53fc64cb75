// SPDX-License-Identifier: Apache-2.0
//
// Takes   tables as other tools export logs: PlotJuggler, `rostopic echo -p`, pandas, messages of
//         ROS with their stamps in two columns.
// Gives   the same table with times in s in a column that readers of logs know, and one column a
//         joint by its name; said in words.
// Units   those that the names say (nsec, nanosec; %time of rostopic is in ns).
#pragma once

#include <string>
#include <vector>

#include "kinematics/core/csv.h"

namespace kinescope {

/// Where no column is named t, time, stamp or timestamp: one from the columns that another tool
/// wrote as the time, in s. Dates in the time become s since 1970. Column numbers without a name
/// (pandas) are left out. Gives one line for each thing that was read so.
/// Throws bad_input for a first column without a name that is neither the time nor counts rows.
[[nodiscard]] std::vector<std::string> make_time_plain(CsvTable& table);

/// Dates of a column (date_time.h) as s since 1970; false where it holds none.
bool dates_to_seconds(CsvTable& table, std::size_t column);

/// The name of each column as a joint log has it: "shoulder" of "/joint_states/shoulder/position",
/// "tau_shoulder" of its effort; empty for what is no joint value there (velocities, counters; of
/// RTDE's fields all but `actual_q_N`, where that is there).
[[nodiscard]] std::vector<std::string> log_names(const CsvTable& table);

/// The table with those names, without the columns that have none but for those in `keep`.
[[nodiscard]] CsvTable with_log_names(CsvTable table, const std::vector<std::string>& keep = {});

}  // namespace kinescope
