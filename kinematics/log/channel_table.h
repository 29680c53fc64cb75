// SPDX-License-Identifier: Apache-2.0
//
// Takes   a wide table, CSV or CSV packed with gzip: one column a channel, one row a sample.
// Gives   ChannelTable: every column as it stands in the file, faults included, with its lines.
// Units   the file's; nothing is converted.
// Method  times as other tools write them become plain (tool_table.h); empty cells and "nan" become
// NaN, infinities stay; columns of words become labels. Not here: what a column means
// (dynamics/data), the strict joint log (joint_log.h).
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// A log as it was written. Where JointLog refuses what a calibration cannot use, this keeps it, so
/// that it can be counted and named.
struct ChannelTable {
  std::string source;              ///< file name, for messages
  std::vector<std::string> names;  ///< the columns of numbers, in the file's order
  Eigen::MatrixXd values;          ///< rows x names; NaN where the file has no number
  std::map<std::string, std::vector<std::string>> labels;  ///< the columns of words
  std::size_t header_line = 1;                             ///< line in the file, from 1
  std::vector<std::size_t> lines;                          ///< line in the file of each row, from 1
  std::vector<std::string> warnings = {};                  ///< of who read it, one line each

  [[nodiscard]] Eigen::Index rows() const { return values.rows(); }
  /// The column of that name, else the one whose name with a unit in brackets it is.
  [[nodiscard]] std::optional<Eigen::Index> column(std::string_view name) const;
  /// "file:line" of a row.
  [[nodiscard]] std::string place(Eigen::Index row) const;
};

/// Throws bad_input as read_csv() does, and where a column of numbers holds a word: file, line,
/// remedy.
[[nodiscard]] ChannelTable read_channel_table(const std::filesystem::path& path);
[[nodiscard]] ChannelTable parse_channel_table(std::string_view text, const std::string& source);

}  // namespace kinescope
