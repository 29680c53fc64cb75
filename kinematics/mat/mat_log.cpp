// SPDX-License-Identifier: Apache-2.0
#include "kinematics/mat/mat_log.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"

namespace kinescope::mat {
namespace {

constexpr const char* kMatRemedy =
    "save vectors and matrices with a row a sample, as t, q, dq, tau";

bool is_time_name(std::string_view name) {
  static constexpr std::array<std::string_view, 4> kNames{"t", "time", "stamp", "timestamp"};
  return std::ranges::find(kNames, name) != kNames.end();
}

Eigen::Index longer_side(const Variable& variable) {
  return std::max(variable.values.rows(), variable.values.cols());
}

// How many samples the log has; 0: no variable has any.
Eigen::Index samples_of(const std::vector<Variable>& variables) {
  for (const Variable& variable : variables)
    if (is_time_name(variable.name) && variable.values.size() > 1 &&
        variable.values.size() == longer_side(variable))
      return variable.values.size();
  std::map<Eigen::Index, int> votes;
  for (const Variable& variable : variables)
    if (variable.values.size() > 1) ++votes[longer_side(variable)];
  Eigen::Index best = 0;
  for (const auto& [samples, count] : votes)
    if (best == 0 || count >= votes[best]) best = samples;  // of as many the longer ones
  return best;
}

// A row a sample; nothing where neither side has as many.
std::optional<Eigen::MatrixXd> upright(const Eigen::MatrixXd& values, Eigen::Index samples) {
  if (values.rows() == samples) return values;
  if (values.cols() == samples) return values.transpose();
  return std::nullopt;
}

std::string sizes_of(const Variable& variable) {
  return fmt::format("{} ({} x {})", variable.name, variable.values.rows(), variable.values.cols());
}

// What is left out, in one line.
void warn_of_rest(const Contents& contents, const std::vector<std::string>& other_sizes,
                  std::vector<std::string>& warnings) {
  std::vector<std::string> words = other_sizes;
  bool has_struct = false;
  for (const LeftOut& one : contents.left_out) {
    words.push_back(fmt::format("{} ({})", one.name, one.what));
    has_struct = has_struct || one.what == "a struct";
  }
  if (words.empty()) return;
  warnings.push_back(fmt::format("variables that are no samples are left out: {}{}",
                                 fmt::join(words, ", "),
                                 has_struct ? "; a struct's fields become variables with: save -v7 "
                                              "FILE -struct NAME"
                                            : ""));
}

void require_different(const ChannelTable& table) {
  std::set<std::string> names;
  for (const std::string& name : table.names) {
    if (names.insert(name).second) continue;
    throw bad_input(table.source, fmt::format("two columns would be named '{}'", name),
                    "rename the variable: columns of a matrix q are q1, q2, ..");
  }
}

}  // namespace

ChannelTable table_of(const Contents& contents, const std::string& source) {
  ChannelTable out;
  out.source = source;
  const Eigen::Index samples = samples_of(contents.variables);
  if (samples == 0) throw bad_input(source, "holds no variable with samples", kMatRemedy);
  std::vector<Eigen::VectorXd> columns;
  std::vector<std::string> other_sizes;
  for (const Variable& variable : contents.variables) {
    const auto values = upright(variable.values, samples);
    if (!values || values->cols() == 0) {
      other_sizes.push_back(sizes_of(variable));
      continue;
    }
    if (columns.size() + static_cast<std::size_t>(values->cols()) > kMostColumns) {
      throw bad_input(source, fmt::format("would be a table of more than {} columns", kMostColumns),
                      kMatRemedy);
    }
    for (Eigen::Index c = 0; c < values->cols(); ++c) {
      out.names.push_back(values->cols() == 1 ? variable.name
                                              : fmt::format("{}{}", variable.name, c + 1));
      columns.emplace_back(values->col(c));
    }
  }
  require_different(out);
  out.values.resize(samples, std::ssize(columns));
  for (std::size_t c = 0; c < columns.size(); ++c)
    out.values.col(static_cast<Eigen::Index>(c)) = columns[c];
  for (Eigen::Index row = 0; row < samples; ++row)
    out.lines.push_back(static_cast<std::size_t>(row) + 1);
  warn_of_rest(contents, other_sizes, out.warnings);
  return out;
}

ChannelTable channel_table(const std::filesystem::path& path) {
  return table_of(read_variables(path), path.string());
}

LogTable joint_table(const std::filesystem::path& path) {
  ChannelTable read = channel_table(path);
  LogTable out;
  out.warnings = std::move(read.warnings);
  out.table.source = read.source;
  out.table.header = read.names;
  out.table.lines = read.lines;
  for (Eigen::Index row = 0; row < read.values.rows(); ++row) {
    std::vector<std::string>& cells = out.table.rows.emplace_back();
    for (const double value : read.values.row(row)) cells.push_back(fmt::format("{}", value));
  }
  return out;
}

}  // namespace kinescope::mat
