// SPDX-License-Identifier: Apache-2.0
//
// Reading tables: values separated by commas, semicolons, tabs or blanks, with one header line.
// Numbers only, except in the columns the caller reads as text. Every complaint names file, line
// and column.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/core/error.h"

namespace kinescope {

/// A row of another length than the header.
struct RaggedRow {
  std::size_t line = 0;   ///< in the file, from 1
  std::size_t cells = 0;  ///< that it has
};

/// A table as text. Rows are as long as the header; blank lines and lines that begin with '#' are
/// passed over, but for the last one above a table that has no header else: where it names as many
/// columns, it is the header (EuRoC).
struct CsvTable {
  std::string source;                          ///< file name, for messages
  std::vector<std::string> header;             ///< column names, trimmed, no two alike
  std::size_t header_line = 1;                 ///< line in the file of the header, from 1
  std::vector<std::string> titles;             ///< lines above the header that are no part of it
  std::vector<std::vector<std::string>> rows;  ///< trimmed cells
  std::vector<std::size_t> lines;              ///< line in the file of each row, from 1
  std::vector<RaggedRow> ragged;               ///< rows set aside (RaggedRows::kSetAside)
  /// What number() multiplies each column by, from the unit in its name; empty: nothing.
  std::vector<double> factors = {};

  [[nodiscard]] std::optional<std::size_t> column(std::string_view name) const;
  /// Column that must be there; throws bad_input that names the columns that are.
  [[nodiscard]] std::size_t require_column(std::string_view name) const;
  /// "file:line" of a row.
  [[nodiscard]] std::string place(std::size_t row) const;
  /// The complaint about a row of another length.
  [[nodiscard]] Error ragged_error(const RaggedRow& row) const;
  /// A finite number. Throws bad_input that names line and column; an empty cell is no number.
  [[nodiscard]] double number(std::size_t row, std::size_t column) const;
  /// As number(), but an empty cell gives nothing.
  [[nodiscard]] std::optional<double> optional_number(std::size_t row, std::size_t column) const;
  /// A whole number. Throws bad_input.
  [[nodiscard]] int integer(std::size_t row, std::size_t column) const;
};

/// What becomes of rows of another length than the header.
enum class RaggedRows { kRefuse, kSetAside };

/// What was passed over above the header, in words: one line, or none.
[[nodiscard]] std::vector<std::string> title_words(const CsvTable& table);

/// The most that is read of one table: more is another file than a log, and would fill the memory.
inline constexpr std::size_t kMostColumns = 10'000;
inline constexpr std::size_t kMostCells = 100'000'000;

/// The name of a first column without one: pandas writes its index so, and reads it back so.
inline constexpr std::string_view kUnnamedColumn = "Unnamed: 0";

/// Parses text. A header without a comma may separate its columns by semicolons, by tabs or (where
/// the next line has as many words) by blanks; then the numbers may have decimal commas, all of
/// them or none. Lines above the header (a title, a date) are passed over where they have other
/// numbers of cells than it and than the row of numbers below it. Lines end in LF, CR LF or CR. A
/// delimiter at the end of a line opens no column. Throws bad_input for: nothing in it, columns
/// separated otherwise, decimal commas beside decimal points, two columns of one name, an unnamed
/// column but the first, more than kMostColumns or kMostCells, a NUL byte, and, unless they are set
/// aside, for rows shorter or longer than the header.
[[nodiscard]] CsvTable parse_csv(std::string_view text, std::string source,
                                 RaggedRows ragged = RaggedRows::kRefuse);
/// The same from a file, also from one packed with gzip.
[[nodiscard]] CsvTable read_csv(const std::filesystem::path& path,
                                RaggedRows ragged = RaggedRows::kRefuse);

/// The whole of the text as a number ("1.5", "-2e-3"), or nothing. NaN and infinities are numbers
/// here.
[[nodiscard]] std::optional<double> parse_number(std::string_view text);

}  // namespace kinescope
