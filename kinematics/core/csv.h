// SPDX-License-Identifier: Apache-2.0
//
// Reading tables: comma separated values with one header line. Numbers only, except in the columns
// the caller reads as text. Every complaint names file, line and column.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kinescope {

/// A table as text. Rows are as long as the header; blank lines and lines that begin with '#' are
/// passed over.
struct CsvTable {
  std::string source;                          ///< file name, for messages
  std::vector<std::string> header;             ///< column names, trimmed, no two alike
  std::size_t header_line = 1;                 ///< line in the file of the header, from 1
  std::vector<std::vector<std::string>> rows;  ///< trimmed cells
  std::vector<std::size_t> lines;              ///< line in the file of each row, from 1

  [[nodiscard]] std::optional<std::size_t> column(std::string_view name) const;
  /// Column that must be there; throws bad_input that names the columns that are.
  [[nodiscard]] std::size_t require_column(std::string_view name) const;
  /// "file:line" of a row.
  [[nodiscard]] std::string place(std::size_t row) const;
  /// A finite number. Throws bad_input that names line and column; an empty cell is no number.
  [[nodiscard]] double number(std::size_t row, std::size_t column) const;
  /// As number(), but an empty cell gives nothing.
  [[nodiscard]] std::optional<double> optional_number(std::size_t row, std::size_t column) const;
  /// A whole number. Throws bad_input.
  [[nodiscard]] int integer(std::size_t row, std::size_t column) const;
};

/// Parses text. Throws bad_input for: nothing in it, another delimiter than the comma, two columns
/// of one name, an unnamed column, a row shorter or longer than the header, a NUL byte. A comma at
/// the end of a line opens no column.
[[nodiscard]] CsvTable parse_csv(std::string_view text, std::string source);
/// The same from a file, also from one packed with gzip.
[[nodiscard]] CsvTable read_csv(const std::filesystem::path& path);

/// The whole of the text as a number ("1.5", "-2e-3"), or nothing. NaN and infinities are numbers
/// here.
[[nodiscard]] std::optional<double> parse_number(std::string_view text);

}  // namespace kinescope
