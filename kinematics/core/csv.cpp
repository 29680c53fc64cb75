// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/csv.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <unordered_set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/gzip.h"
#include "kinematics/core/text.h"

namespace kinescope {
namespace {

std::string_view trim(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\"";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

/// The lines of a text, also of one whose lines all end in CR alone.
class Lines {
 public:
  explicit Lines(std::string_view text)
      : rest_(text), end_(text.find('\n') == std::string_view::npos ? '\r' : '\n') {}

  std::optional<std::string_view> next() {
    if (rest_.empty()) return std::nullopt;
    const std::size_t end = rest_.find(end_);
    const std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    ++number_;
    return line;
  }
  /// The next line that is neither blank nor a comment.
  std::optional<std::string_view> next_content() {
    while (const auto line = next()) {
      const std::string_view content = trim(*line);
      if (content.empty()) continue;
      if (!content.starts_with('#')) return line;
      last_comment_ = {content.substr(1), number_};
    }
    return std::nullopt;
  }
  struct Comment {
    std::string_view text;   ///< behind the '#'
    std::size_t number = 0;  ///< of its line; 0: there was none
  };
  [[nodiscard]] const Comment& last_comment() const { return last_comment_; }
  [[nodiscard]] std::size_t number() const { return number_; }

 private:
  std::string_view rest_;
  char end_;
  std::size_t number_ = 0;
  Comment last_comment_;
};

/// Words between blanks, of which several are one.
std::vector<std::string> split_words(std::string_view line) {
  std::vector<std::string> words;
  line = trim(line);
  while (!line.empty()) {
    const std::string_view word = line.substr(0, line.find_first_of(" \t"));
    words.emplace_back(trim(word));
    line = trim(line.substr(word.size()));
  }
  return words;
}

std::size_t count_cells(std::string_view line, char delimiter) {
  if (delimiter == ' ') return split_words(line).size();
  return static_cast<std::size_t>(std::ranges::count(line, delimiter)) + 1;
}

std::vector<std::string> split(std::string_view line, char delimiter) {
  if (delimiter == ' ') return split_words(line);
  std::vector<std::string> cells;
  cells.reserve(count_cells(line, delimiter));
  std::size_t begin = 0;
  while (true) {
    const std::size_t end = line.find(delimiter, begin);
    cells.emplace_back(trim(line.substr(begin, end - begin)));
    if (end == std::string_view::npos) return cells;
    begin = end + 1;
  }
}

/// Control characters stand in no text: within the first few thousand bytes of a binary file there
/// are some.
bool looks_binary(std::string_view text) {
  constexpr std::size_t kLooked = 4096;
  return std::ranges::any_of(text.substr(0, kLooked), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte < 0x20U && c != '\t' && c != '\r' && c != '\n' && c != '\f' && c != '\v';
  });
}

/// "1,5" as "1.5"; nothing for what is no number with a decimal comma.
std::optional<std::string> with_decimal_point(const std::string& cell) {
  const std::size_t comma = cell.find(',');
  if (comma == std::string::npos) return std::nullopt;
  std::string text = cell;
  text[comma] = '.';
  if (!parse_number(text)) return std::nullopt;
  return text;
}

bool holds_only_numbers(std::string_view line, char delimiter) {
  std::vector<std::string> cells = split(line, delimiter);
  if (cells.size() > 1 && cells.back().empty()) cells.pop_back();
  return std::ranges::all_of(cells, [](const std::string& cell) {
    return parse_number(cell).has_value() || with_decimal_point(cell).has_value();
  });
}

/// Parses one text: header, rows, decimal commas.
class TableParser {
 public:
  TableParser(std::string_view text, CsvTable& table)
      : table_(table), lines_(text), binary_(looks_binary(text)) {}

  void read_header() {
    pass_titles();
    auto line = lines_.next_content();
    if (!line) throw bad_input(table_.source, "is empty", "record it again");
    table_.header_line = lines_.number();
    if (is_headed_by_comment(*line)) {
      first_row_ = line;
      line = lines_.last_comment().text;
      table_.header_line = lines_.last_comment().number;
    }
    delimiter_ = find_delimiter(trim(*line));
    if (count_cells(*line, delimiter_) > kMostColumns + 1) {
      refuse(
          fmt::format("has {} columns, more than {}", count_cells(*line, delimiter_), kMostColumns),
          "is this the right file?");
    }
    table_.header = split(*line, delimiter_);
    if (table_.header.size() > 1 && table_.header.front().empty())
      table_.header.front() = kUnnamedColumn;
    unnamed_end_ = table_.header.size() > 1 && table_.header.back().empty();
    if (unnamed_end_) table_.header.pop_back();
    check_header(*line);
  }

  void read_rows(RaggedRows ragged) {
    if (first_row_) add_row(*first_row_, ragged);
    while (const auto line = lines_.next_content()) add_row(*line, ragged);
    if (!table_.rows.empty()) return;
    if (!table_.ragged.empty()) throw table_.ragged_error(table_.ragged.front());
    throw bad_input(table_.source, "has a header but no rows", "record it again");
  }

  /// One way of writing numbers a table: "1,234" beside "5.678" may be a thousand.
  void read_decimal_commas() {
    if (delimiter_ == ',') return;
    std::optional<std::size_t> with_comma;
    std::optional<std::size_t> with_point;
    for (std::size_t r = 0; r < table_.rows.size(); ++r) {
      for (std::string& cell : table_.rows[r]) {
        if (auto text = with_decimal_point(cell)) {
          cell = *std::move(text);
          with_comma = with_comma.value_or(r);
        } else if (cell.find('.') != std::string::npos && parse_number(cell)) {
          with_point = with_point.value_or(r);
        }
      }
      if (with_comma && with_point) {
        throw bad_input(table_.place(r),
                        fmt::format("decimal commas (line {}) beside decimal points (line {})",
                                    table_.lines[*with_comma], table_.lines[*with_point]),
                        "write all numbers with a point, and none with a separator of thousands");
      }
    }
  }

 private:
  /// Titles have no fixed form; the header shows by the row below it, which has as many cells.
  void pass_titles() {
    constexpr std::size_t kMostTitles = 50;  // a report's cover sheet; beyond it is another table
    std::vector<std::string_view> above;
    Lines next = lines_;
    for (Lines from = lines_; above.size() <= kMostTitles; from = next) {
      const auto line = next.next_content();
      if (!line) return;
      if (heads_numbers(*line, next, above)) {
        for (const std::string_view title : above) table_.titles.emplace_back(trim(title));
        lines_ = from;
        return;
      }
      above.push_back(*line);
    }
  }

  /// Names, with rows of as many cells below, the first with a number, and other lines above. Of
  /// two lines a cover sheet may look so ("Robot,UR5" above "Rate,100").
  [[nodiscard]] static bool heads_numbers(std::string_view line, Lines below,
                                          const std::vector<std::string_view>& above) {
    const auto row = below.next_content();
    if (!row) return false;
    const auto another = below.next_content();
    const auto is_number = [](const std::string& cell) {
      return parse_number(cell).has_value() || with_decimal_point(cell).has_value();
    };
    for (const char delimiter : {',', ';', '\t', ' '}) {
      const std::vector<std::string> names = split(line, delimiter);
      const std::vector<std::string> cells = split(*row, delimiter);
      if (names.size() < 2 || names.size() != cells.size()) continue;
      if (another && count_cells(*another, delimiter) != names.size()) continue;
      if (std::ranges::any_of(names, is_number)) continue;
      if (std::ranges::none_of(cells, is_number)) continue;
      return std::ranges::none_of(above, [&](std::string_view title) {
        return count_cells(title, delimiter) == names.size();
      });
    }
    return false;
  }

  [[noreturn]] void refuse(std::string_view what, std::string_view remedy) const {
    refuse_binary();
    throw bad_input(fmt::format("{}:{}", table_.source, table_.header_line), what, remedy);
  }

  void refuse_binary() const {
    if (!binary_) return;
    throw bad_input(table_.source, "is a binary file or damaged, not UTF-8 text",
                    "export the table as CSV (UTF-8)");
  }

  [[nodiscard]] char find_delimiter(std::string_view header) const {
    if (header.find(',') != std::string_view::npos) return ',';
    const bool semicolon = header.find(';') != std::string_view::npos;
    const bool tab = header.find('\t') != std::string_view::npos;
    if (semicolon && tab) {
      refuse("columns are separated by ';' or by tabs: both stand in the header",
             "use one of them, or commas");
    }
    if (semicolon || tab) return semicolon ? ';' : '\t';
    return is_in_words(header) ? ' ' : ',';
  }

  /// Blanks separate columns where the line below has as many words; a title has others.
  [[nodiscard]] bool is_in_words(std::string_view header) const {
    const std::size_t words = split_words(header).size();
    Lines below = lines_;
    const auto next = first_row_ ? first_row_ : below.next_content();
    return words > 1 && next && split_words(*next).size() == words;
  }

  /// EuRoC's tables: "#timestamp [ns],filename" above rows that begin with a number.
  [[nodiscard]] bool is_headed_by_comment(std::string_view line) const {
    const std::string_view comment = lines_.last_comment().text;
    const char delimiter = find_delimiter(trim(line));
    if (!parse_number(split(line, delimiter).front())) return false;
    const std::vector<std::string> names = split(comment, delimiter);
    return names.size() > 1 && names.size() == count_cells(line, delimiter) &&
           std::ranges::none_of(names, [](const std::string& name) {
             return name.empty() || parse_number(name).has_value();
           });
  }

  void check_header(std::string_view line) const {
    const std::vector<std::string>& header = table_.header;
    if (header.size() == 1 && header[0].find(' ') != std::string::npos) {
      refuse("columns are separated by ' '",
             "separate them by commas, with a point in decimal numbers");
    }
    // "1,5;2,5" has decimal commas and no names.
    if (holds_only_numbers(line, delimiter_) || holds_only_numbers(line, ';') ||
        holds_only_numbers(line, '\t')) {
      refuse("the first line holds numbers, not column names",
             "add a header line such as t,joint1,joint2");
    }
    std::unordered_set<std::string_view> known;
    for (std::size_t i = 0; i < header.size(); ++i) {
      if (header[i].empty()) refuse_unnamed(i + 1);
      if (!known.insert(header[i]).second) {
        refuse(fmt::format("two columns are named '{}'", header[i]),
               "give every column its own name");
      }
    }
  }

  [[noreturn]] void refuse_unnamed(std::size_t column) const {
    refuse(fmt::format("column {} has no name", column), "name every column");
  }

  void add_row(std::string_view line, RaggedRows ragged) {
    const std::size_t columns = table_.header.size();
    const std::size_t cells = count_cells(line, delimiter_);
    std::vector<std::string> row;
    if (cells == columns || cells == columns + 1) row = split(line, delimiter_);
    // Some loggers end every line with a delimiter.
    if (row.size() == columns + 1 && row.back().empty()) row.pop_back();
    if (row.size() == columns + 1 && unnamed_end_) refuse_unnamed(row.size());
    if (row.size() == columns) {
      table_.rows.push_back(std::move(row));
      table_.lines.push_back(lines_.number());
      refuse_too_many_cells();
      return;
    }
    refuse_binary();
    table_.ragged.push_back({lines_.number(), cells});
    if (ragged == RaggedRows::kRefuse) throw table_.ragged_error(table_.ragged.back());
  }

  void refuse_too_many_cells() const {
    if (table_.rows.size() * table_.header.size() <= kMostCells) return;
    throw bad_input(table_.source, fmt::format("has more than {} cells", kMostCells),
                    "is this the right file? A longer log is cut into several");
  }

  CsvTable& table_;
  Lines lines_;
  bool binary_;
  char delimiter_ = ',';
  bool unnamed_end_ = false;
  std::optional<std::string_view> first_row_;  ///< where a comment above it was the header
};

// As of ISO 8601 or a clock: digits with two colons between them.
bool is_date(std::string_view cell) {
  return !cell.empty() && std::isdigit(static_cast<unsigned char>(cell.front())) != 0 &&
         std::ranges::count(cell, ':') >= 2;
}

}  // namespace

std::optional<std::size_t> CsvTable::column(std::string_view name) const {
  const auto found = std::ranges::find(header, name);
  if (found == header.end()) return std::nullopt;
  return static_cast<std::size_t>(found - header.begin());
}

std::size_t CsvTable::require_column(std::string_view name) const {
  if (const auto found = column(name)) return *found;
  throw bad_input(
      fmt::format("{}:{}", source, header_line), fmt::format("no column '{}'", name),
      fmt::format("name the one that holds it so; the columns are {}", fmt::join(header, ", ")));
}

std::string CsvTable::place(std::size_t row) const {
  return fmt::format("{}:{}", source, lines[row]);
}

Error CsvTable::ragged_error(const RaggedRow& row) const {
  return bad_input(fmt::format("{}:{}", source, row.line),
                   fmt::format("{} cells where the header has {}", row.cells, header.size()),
                   "is the file cut off, or a comma missing?");
}

double CsvTable::number(std::size_t row, std::size_t column) const {
  const std::string& cell = rows[row][column];
  const std::optional<double> value = parse_number(cell);
  if (!value || !std::isfinite(*value)) {
    throw bad_input(
        place(row),
        fmt::format("column '{}' holds '{}', not a finite number", header[column], cell),
        is_date(cell) ? "write times in s, such as those since the first row, not as dates"
                      : "correct or remove the line");
  }
  return factors.empty() ? *value : *value * factors[column];
}

std::vector<std::string> title_words(const CsvTable& table) {
  if (table.titles.empty()) return {};
  return {fmt::format(
      "{}: {} above the header in line {} passed over: '{}'{}", table.source,
      table.titles.size() == 1 ? "a line" : fmt::format("{} lines", table.titles.size()),
      fmt::format("{} {}", table.header_line, table.titles.size() == 1 ? "is" : "are"),
      clean_text(table.titles.front()), table.titles.size() == 1 ? "" : ", ..")};
}

std::optional<double> CsvTable::optional_number(std::size_t row, std::size_t column) const {
  if (rows[row][column].empty()) return std::nullopt;
  return number(row, column);
}

int CsvTable::integer(std::size_t row, std::size_t column) const {
  const std::optional<double> value = parse_number(rows[row][column]);
  if (!value || *value != std::floor(*value) || std::abs(*value) > 1e9) {
    throw bad_input(place(row),
                    fmt::format("column '{}' holds '{}', not a whole number", header[column],
                                rows[row][column]),
                    "correct or remove the line");
  }
  return static_cast<int>(*value);
}

CsvTable parse_csv(std::string_view text, std::string source, RaggedRows ragged) {
  CsvTable table;
  table.source = std::move(source);
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (text.find('\0') != std::string_view::npos) {
    throw bad_input(table.source, "holds NUL bytes, so it is not a text table",
                    "export the table as CSV (UTF-8)");
  }
  TableParser parser(text, table);
  parser.read_header();
  parser.read_rows(ragged);
  parser.read_decimal_commas();
  return table;
}

CsvTable read_csv(const std::filesystem::path& path, RaggedRows ragged) {
  return parse_csv(read_plain_or_gzip(path), path.string(), ragged);
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
