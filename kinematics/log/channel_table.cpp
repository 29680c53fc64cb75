// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/channel_table.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"
#include "kinematics/core/text.h"
#include "kinematics/log/header_units.h"
#include "kinematics/log/tool_table.h"

namespace kinescope {
namespace {

bool is_missing(std::string_view cell) {
  constexpr std::array<std::string_view, 9> kMissing = {"",     "NA",   "N/A", "n/a", "null",
                                                        "NULL", "None", "-",   "#N/A"};
  return std::ranges::find(kMissing, cell) != kMissing.end();
}

/// A cell that is neither a number nor missing; none when the whole column can be read as numbers.
struct ColumnOfNumbers {
  Eigen::VectorXd values;
  std::size_t words = 0;
  std::size_t first_word = 0;  ///< row; of use only when there are words
};

ColumnOfNumbers read_column(const CsvTable& table, std::size_t column) {
  ColumnOfNumbers out;
  out.values.resize(static_cast<Eigen::Index>(table.rows.size()));
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const std::string& cell = table.rows[row][column];
    const std::optional<double> number = parse_number(cell);
    if (!number && !is_missing(cell) && out.words++ == 0) out.first_word = row;
    out.values(static_cast<Eigen::Index>(row)) =
        number.value_or(std::numeric_limits<double>::quiet_NaN());
  }
  return out;
}

/// Words in most rows are labels; a word here and there is a fault.
bool is_label_column(const ColumnOfNumbers& column) {
  return 2 * column.words > static_cast<std::size_t>(column.values.size());
}

ChannelTable from_csv(CsvTable csv) {
  std::vector<std::string> said = title_words(csv);
  append_unsaid(said, make_time_plain(csv));
  ChannelTable table{.source = csv.source,
                     .names = {},
                     .values = {},
                     .labels = {},
                     .header_line = csv.header_line,
                     .lines = csv.lines,
                     .warnings = std::move(said)};
  const auto rows = static_cast<Eigen::Index>(csv.rows.size());
  table.values.resize(rows, static_cast<Eigen::Index>(csv.header.size()));
  Eigen::Index used = 0;
  for (std::size_t c = 0; c < csv.header.size(); ++c) {
    const ColumnOfNumbers column = read_column(csv, c);
    if (is_label_column(column)) {
      std::vector<std::string>& labels = table.labels[csv.header[c]];
      labels.reserve(csv.rows.size());
      for (const std::vector<std::string>& row : csv.rows) labels.push_back(row[c]);
      continue;
    }
    if (column.words > 0) {
      throw bad_input(csv.place(column.first_word),
                      fmt::format("column '{}' holds '{}', not a number", csv.header[c],
                                  csv.rows[column.first_word][c]),
                      "correct or remove the line");
    }
    table.names.push_back(csv.header[c]);
    table.values.col(used++) = column.values;
  }
  table.values.conservativeResize(rows, used);
  return table;
}

}  // namespace

std::optional<Eigen::Index> ChannelTable::column(std::string_view name) const {
  auto found = std::ranges::find(names, name);
  if (found == names.end()) found = std::ranges::find(names, name, without_unit);
  if (found == names.end()) return std::nullopt;
  return found - names.begin();
}

std::string ChannelTable::place(Eigen::Index row) const {
  return fmt::format("{}:{}", source, lines[static_cast<std::size_t>(row)]);
}

ChannelTable read_channel_table(const std::filesystem::path& path) {
  return from_csv(read_csv(path));
}

ChannelTable parse_channel_table(std::string_view text, const std::string& source) {
  return from_csv(parse_csv(text, source));
}

}  // namespace kinescope
