// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/bad_rows.h"

#include <algorithm>

#include <fmt/format.h>

namespace kinescope {
namespace {

/// An error's line without its remedy, which stands in parentheses at its end.
std::string_view complaint_of(const Error& error) {
  const std::string_view line = error.what();
  int open = 0;
  for (std::size_t i = line.size(); i-- > 0;) {
    if (line[i] == ')') ++open;
    if (line[i] == '(') --open;
    if (open == 0) return i == line.size() - 1 ? line : line.substr(0, i - 1);
  }
  return line;
}

}  // namespace

BadRows::BadRows(std::string source, std::size_t count, std::string unit)
    : source_(std::move(source)), unit_(std::move(unit)), count_(count) {}

BadRows::BadRows(const CsvTable& table)
    : BadRows(table.source, table.rows.size() + table.ragged.size(), "rows") {
  titles_ = title_words(table);
  for (const RaggedRow& row : table.ragged) add(row.line, table.ragged_error(row));
}

bool BadRows::too_many(std::size_t bad) const {
  constexpr std::size_t kInShortTables = 3;
  constexpr std::size_t kOneIn = 20;
  return bad > std::max(kInShortTables, count_ / kOneIn) || 2 * bad >= count_;
}

void BadRows::add(std::size_t line, const Error& error) {
  errors_.emplace_back(line, error);
  if (too_many(errors_.size())) throw first();
}

const Error& BadRows::first() const {
  return std::ranges::min_element(errors_, {}, &std::pair<std::size_t, Error>::first)->second;
}

std::vector<std::string> BadRows::warnings() const {
  std::vector<std::string> out = titles_;
  if (errors_.size() == 1) out.push_back(fmt::format("{}: left out", complaint_of(first())));
  if (errors_.size() > 1) {
    out.push_back(fmt::format("{}: {} of {} {} are left out, the first: {}", source_,
                              errors_.size(), count_, unit_, complaint_of(first())));
  }
  return out;
}

}  // namespace kinescope
