// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"
#include "kinematics/core/gzip.h"

namespace kinescope {
namespace {

std::string_view trim(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\"";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::vector<std::string> split(std::string_view line) {
  std::vector<std::string> cells;
  std::size_t begin = 0;
  while (true) {
    const std::size_t comma = line.find(',', begin);
    cells.emplace_back(trim(line.substr(begin, comma - begin)));
    if (comma == std::string_view::npos) return cells;
    begin = comma + 1;
  }
}

void check_header(const CsvTable& table) {
  const std::string where = fmt::format("{}:{}", table.source, table.header_line);
  if (table.header.size() == 1) {
    for (const char delimiter : {';', '\t', ' '}) {
      if (table.header[0].find(delimiter) == std::string::npos) continue;
      throw bad_input(where,
                      fmt::format("columns are separated by '{}'",
                                  delimiter == '\t' ? "tab" : std::string(1, delimiter)),
                      "separate them by commas, with a point in decimal numbers");
    }
  }
  const bool all_numbers = std::ranges::all_of(
      table.header, [](const std::string& name) { return parse_number(name).has_value(); });
  if (all_numbers) {
    throw bad_input(where, "the first line holds numbers, not column names",
                    "add a header line such as t,joint1,joint2");
  }
  for (std::size_t i = 0; i < table.header.size(); ++i) {
    if (table.header[i].empty()) {
      throw bad_input(where, fmt::format("column {} has no name", i + 1), "name every column");
    }
    if (std::find(table.header.begin(), table.header.begin() + static_cast<std::ptrdiff_t>(i),
                  table.header[i]) != table.header.begin() + static_cast<std::ptrdiff_t>(i)) {
      throw bad_input(where, fmt::format("two columns are named '{}'", table.header[i]),
                      "give every column its own name");
    }
  }
}

}  // namespace

std::optional<std::size_t> CsvTable::column(std::string_view name) const {
  const auto found = std::ranges::find(header, name);
  if (found == header.end()) return std::nullopt;
  return static_cast<std::size_t>(found - header.begin());
}

std::size_t CsvTable::require_column(std::string_view name) const {
  if (const auto found = column(name)) return *found;
  throw bad_input(fmt::format("{}:{}", source, header_line), fmt::format("no column '{}'", name),
                  fmt::format("the columns are {}", fmt::join(header, ", ")));
}

std::string CsvTable::place(std::size_t row) const {
  return fmt::format("{}:{}", source, lines[row]);
}

double CsvTable::number(std::size_t row, std::size_t column) const {
  const std::string& cell = rows[row][column];
  const std::optional<double> value = parse_number(cell);
  if (!value || !std::isfinite(*value)) {
    throw bad_input(
        place(row),
        fmt::format("column '{}' holds '{}', not a finite number", header[column], cell),
        "correct or remove the line");
  }
  return *value;
}

std::optional<double> CsvTable::optional_number(std::size_t row, std::size_t column) const {
  if (rows[row][column].empty()) return std::nullopt;
  return number(row, column);
}

int CsvTable::integer(std::size_t row, std::size_t column) const {
  const double value = number(row, column);
  if (value != std::floor(value) || std::abs(value) > 1e9) {
    throw bad_input(place(row),
                    fmt::format("column '{}' holds '{}', not a whole number", header[column],
                                rows[row][column]),
                    "correct or remove the line");
  }
  return static_cast<int>(value);
}

CsvTable parse_csv(std::string_view text, std::string source) {
  CsvTable table;
  table.source = std::move(source);
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (text.find('\0') != std::string_view::npos) {
    throw bad_input(table.source, "holds NUL bytes, so it is not a text table",
                    "export the table as CSV (UTF-8)");
  }
  std::size_t line_number = 0;
  bool unnamed_end = false;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    ++line_number;
    const std::string_view content = trim(line);
    if (content.empty() || content.starts_with('#')) continue;
    std::vector<std::string> cells = split(line);
    if (table.header.empty()) {
      unnamed_end = cells.size() > 1 && cells.back().empty();
      if (unnamed_end) cells.pop_back();
      table.header = std::move(cells);
      table.header_line = line_number;
      check_header(table);
      continue;
    }
    // Some loggers end every line with a comma.
    const bool one_more = cells.size() == table.header.size() + 1;
    if (one_more && cells.back().empty()) cells.pop_back();
    if (one_more && cells.size() > table.header.size() && unnamed_end) {
      throw bad_input(fmt::format("{}:{}", table.source, table.header_line),
                      fmt::format("column {} has no name", cells.size()), "name every column");
    }
    if (cells.size() != table.header.size()) {
      throw bad_input(
          fmt::format("{}:{}", table.source, line_number),
          fmt::format("{} cells where the header has {}", cells.size(), table.header.size()),
          "is the file cut off, or a comma missing?");
    }
    table.rows.push_back(std::move(cells));
    table.lines.push_back(line_number);
  }
  if (table.header.empty()) throw bad_input(table.source, "is empty", "record it again");
  if (table.rows.empty()) {
    throw bad_input(table.source, "has a header but no rows", "record it again");
  }
  return table;
}

CsvTable read_csv(const std::filesystem::path& path) {
  return parse_csv(read_plain_or_gzip(path), path.string());
}

std::optional<double> parse_number(std::string_view text) {
  text = trim(text);
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || text.empty()) return std::nullopt;
  return value;
}

}  // namespace kinescope
