// SPDX-License-Identifier: Apache-2.0
//
// Takes   the variables of a MAT-file, named as the columns of a table are.
// Gives   the table: a sample a row.
// Method  the samples are as many as the time has values (without one: as most variables have along
//         their longer side). A vector is a column; a matrix is one a joint: q is q1, q2, ..
// Units   the file's; nothing is converted.
// Not here: what a column means (dynamics/data).
#pragma once

#include <filesystem>
#include <string>

#include "kinematics/core/csv.h"
#include "kinematics/log/channel_table.h"
#include "kinematics/mat/mat_file.h"

namespace kinescope::mat {

/// Variables of other sizes are left out with a warning. Throws bad_input: no variable with
/// samples, columns of one name, more than kMostColumns.
[[nodiscard]] ChannelTable table_of(const Contents& contents, const std::string& source);

[[nodiscard]] ChannelTable channel_table(const std::filesystem::path& path);

struct LogTable {
  CsvTable table;  ///< lines: the samples, from 1
  std::vector<std::string> warnings;
};
/// The same as a joint log's table.
[[nodiscard]] LogTable joint_table(const std::filesystem::path& path);

}  // namespace kinescope::mat
