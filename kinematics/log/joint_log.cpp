// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/joint_log.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <limits>

#include <fmt/format.h>

#include "kinematics/core/bad_rows.h"
#include "kinematics/core/error.h"
#include "kinematics/core/longest_increasing.h"
#include "kinematics/log/header_units.h"
#include "kinematics/log/joint_log_table.h"
#include "kinematics/log/unwrap.h"

namespace kinescope {
namespace {

bool is_blank(const std::string& cell) {
  const auto value = parse_number(cell);
  return cell.empty() || (value && std::isnan(*value));
}

bool holds_a_number(const CsvTable& table, std::size_t column) {
  return std::ranges::any_of(table.rows, [&](const std::vector<std::string>& row) {
    const auto value = parse_number(row[column]);
    return value && std::isfinite(*value);
  });
}

bool is_listed(const std::vector<std::string>& names, const std::string& column) {
  return std::ranges::find(names, column) != names.end() ||
         std::ranges::find(names, column, without_unit) != names.end();
}

// The columns of the channels; names them, the torques and what is no channel in `log`.
std::vector<std::size_t> channel_columns(const CsvTable& table, std::size_t time,
                                         const std::vector<std::string>& torque_channels,
                                         JointLog& log) {
  std::vector<std::size_t> columns;
  for (std::size_t c = 0; c < table.header.size(); ++c) {
    const std::string& name = table.header[c];
    if (c == time) continue;
    if (name.starts_with("tau") || is_listed(torque_channels, name)) {
      log.torque_columns.push_back(name);
    } else if (!holds_a_number(table, c)) {
      log.left_out.push_back(name);
      log.warnings.push_back(
          fmt::format("{}: column '{}' holds no number and is left out", table.source, name));
    } else {
      columns.push_back(c);
      log.channels.push_back(name);
    }
  }
  if (!columns.empty()) return columns;
  throw bad_input(fmt::format("{}:{}", table.source, table.header_line),
                  fmt::format("no joint channel beside '{}'", table.header[time]),
                  "add one column a joint with its value in rad, m or ticks");
}

// The first row in which every channel has spoken; the first of all where there is none.
std::size_t first_whole_row(const CsvTable& table, const std::vector<std::size_t>& columns) {
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    const bool whole =
        std::ranges::none_of(columns, [&](std::size_t c) { return is_blank(table.rows[r][c]); });
    if (whole) return r;
  }
  return 0;
}

// Interpolation across a jump to the other end of the range gives postures that never were.
void unwrap_channels(JointLog& log) {
  for (Eigen::Index c = 0; c < log.values.cols(); ++c) {
    const auto unwrapped = unwrap(log.times_s, log.values.col(c));
    if (!unwrapped) continue;
    const auto row = static_cast<Eigen::Index>(unwrapped->first);
    log.warnings.push_back(fmt::format(
        "{}: channel '{}' starts again at the end of its range ({} jumps, the first from {:g} to "
        "{:g} at t = {:.3f} s): it is unwrapped, with a period of {:.6g}",
        log.source, log.channels[static_cast<std::size_t>(c)], unwrapped->jumps, log.values(row, c),
        log.values(row + 1, c), log.times_s[unwrapped->first], unwrapped->period));
    log.values.col(c) = unwrapped->values;
  }
}

// The rows from `first` on, without those that hold no numbers and those that repeat the one
// before; gives the table's row of each.
std::vector<std::size_t> read_samples(const CsvTable& table, std::size_t time, std::size_t first,
                                      const std::vector<std::size_t>& columns, BadRows& bad,
                                      JointLog& log) {
  std::vector<std::size_t> rows;
  int repeated = 0;
  log.values.resize(static_cast<Eigen::Index>(table.rows.size() - first),
                    static_cast<Eigen::Index>(columns.size()));
  for (std::size_t r = first; r < table.rows.size(); ++r) {
    const auto row = static_cast<Eigen::Index>(log.size());
    double time_s = 0.0;
    try {
      time_s = table.number(r, time);
      for (std::size_t c = 0; c < columns.size(); ++c) {
        log.values(row, static_cast<Eigen::Index>(c)) = table.number(r, columns[c]);
      }
    } catch (const Error& error) {
      bad.add(table.lines[r], error);
      continue;
    }
    if (!log.empty() && time_s == log.times_s.back() &&
        log.values.row(row) == log.values.row(row - 1)) {
      ++repeated;
      continue;
    }
    log.times_s.push_back(time_s);
    rows.push_back(r);
  }
  if (repeated > 0) {
    log.warnings.push_back(
        fmt::format("{}: {} rows repeat the row before and are left out", table.source, repeated));
  }
  return rows;
}

Error stamp_error(const std::string& source, std::size_t line, const std::string& what) {
  return bad_input(fmt::format("{}:{}", source, line), what,
                   "sort the rows by time and remove repeated stamps");
}

// Throws at the first stamp that does not come after the one before.
[[noreturn]] void throw_first_descent(const JointLog& log, const CsvTable& table,
                                      const std::vector<std::size_t>& rows) {
  const auto at = std::ranges::adjacent_find(log.times_s, std::greater_equal{});
  const auto i = static_cast<std::size_t>(at - log.times_s.begin());
  throw stamp_error(log.source, table.lines[rows[i + 1]],
                    fmt::format("time {:.6f} s does not come after {:.6f} s", log.times_s[i + 1],
                                log.times_s[i]));
}

void sort_out_stamps(const CsvTable& table, BadRows& bad, TableLog& read) {
  JointLog& log = read.log;
  const std::vector<Eigen::Index> kept = longest_increasing(log.times_s);
  const std::size_t out_of_order = log.size() - kept.size();
  if (out_of_order == 0) return;
  if (bad.too_many(bad.size() + out_of_order)) throw_first_descent(log, table, read.rows);
  std::vector<double> times_s;
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < log.size(); ++i) {
    const std::size_t next = times_s.size();
    if (next < kept.size() && kept[next] == static_cast<Eigen::Index>(i)) {
      times_s.push_back(log.times_s[i]);
      rows.push_back(read.rows[i]);
      continue;
    }
    const bool late = !times_s.empty() && log.times_s[i] <= times_s.back();
    const double other = late ? times_s.back() : log.times_s[static_cast<std::size_t>(kept[next])];
    const std::size_t line = table.lines[read.rows[i]];
    bad.add(line, stamp_error(log.source, line,
                              fmt::format("time {:.6f} s does not come {} {:.6f} s", log.times_s[i],
                                          late ? "after" : "before", other)));
  }
  log.times_s = std::move(times_s);
  log.values = log.values(kept, Eigen::all).eval();
  read.rows = std::move(rows);
}

void to_seconds(double factor, JointLog& log) {
  if (factor == 1.0) return;
  for (double& time_s : log.times_s) time_s *= factor;
}

// Slope at sample i from its neighbours (parabola through three points; one-sided at the ends).
double slope(const JointLog& log, int channel, std::size_t i) {
  const std::size_t n = log.size();
  const auto value = [&](std::size_t k) {
    return log.values(static_cast<Eigen::Index>(k), channel);
  };
  const auto secant = [&](std::size_t k) {
    return (value(k + 1) - value(k)) / (log.times_s[k + 1] - log.times_s[k]);
  };
  if (i == 0) return secant(0);
  if (i == n - 1) return secant(n - 2);
  const double left = log.times_s[i] - log.times_s[i - 1];
  const double right = log.times_s[i + 1] - log.times_s[i];
  return (secant(i - 1) * right + secant(i) * left) / (left + right);
}

ChannelValue hermite(const JointLog& log, int channel, std::size_t i, double time_s) {
  const double h = log.times_s[i + 1] - log.times_s[i];
  const double u = (time_s - log.times_s[i]) / h;
  const double y0 = log.values(static_cast<Eigen::Index>(i), channel);
  const double y1 = log.values(static_cast<Eigen::Index>(i + 1), channel);
  const double m0 = h * slope(log, channel, i);
  const double m1 = h * slope(log, channel, i + 1);
  const double u2 = u * u;
  const double u3 = u2 * u;
  const double value = (2 * u3 - 3 * u2 + 1) * y0 + (u3 - 2 * u2 + u) * m0 +
                       (-2 * u3 + 3 * u2) * y1 + (u3 - u2) * m1;
  const double rate = ((6 * u2 - 6 * u) * y0 + (3 * u2 - 4 * u + 1) * m0 + (-6 * u2 + 6 * u) * y1 +
                       (3 * u2 - 2 * u) * m1) /
                      h;
  return {value, rate};
}

// Second differences against first ones, where the stamps are close enough to interpolate. Of n
// samples a period their squares' ratio is 4 sin(pi/n)^2, below 1 for n > 6; of noise and of
// postures drawn by lot it is 3, of stops with several samples each 2, of steps to and fro up to 4.
// Below 1 the line between a reading's neighbours predicts it to half a step: it was passed
// through.
bool moves_smoothly(const JointLog& log, int channel) {
  constexpr int kMinTriples = 20;         // fewer may lie in line by chance
  constexpr double kMinShareOfWay = 0.1;  // what only settles at its stops rests there
  double first = 0.0;
  double second = 0.0;
  double way = 0.0;
  double way_within = 0.0;
  int triples = 0;
  double before = 0.0;  // the last step, if it was within a stretch
  bool within = false;
  for (std::size_t i = 1; i < log.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double step = log.values(row, channel) - log.values(row - 1, channel);
    const bool close = log.times_s[i] - log.times_s[i - 1] <= kMaxGap;
    way += std::abs(step);
    if (close) {
      way_within += std::abs(step);
      first += step * step;
      if (within) {
        second += (step - before) * (step - before);
        ++triples;
      }
    }
    within = close;
    before = step;
  }
  return triples >= kMinTriples && way_within > kMinShareOfWay * way && second < first;
}

enum class Quantity { kValue, kRate };

Eigen::MatrixXd resample_quantity(const JointLog& log, const std::vector<double>& times_s,
                                  double time_offset_s, double max_gap_s, Quantity quantity) {
  const auto channels = static_cast<Eigen::Index>(log.channels.size());
  Eigen::MatrixXd out =
      Eigen::MatrixXd::Constant(static_cast<Eigen::Index>(times_s.size()), channels,
                                std::numeric_limits<double>::quiet_NaN());
  for (std::size_t f = 0; f < times_s.size(); ++f) {
    for (Eigen::Index c = 0; c < channels; ++c) {
      const auto sample =
          interpolate(log, static_cast<int>(c), times_s[f] + time_offset_s, max_gap_s);
      if (!sample) continue;
      out(static_cast<Eigen::Index>(f), c) =
          quantity == Quantity::kValue ? sample->value : sample->rate;
    }
  }
  return out;
}

}  // namespace

std::optional<int> JointLog::channel(std::string_view name) const {
  auto found = std::ranges::find(channels, name);
  if (found == channels.end()) found = std::ranges::find(channels, without_unit(name));
  if (found == channels.end()) return std::nullopt;
  return static_cast<int>(found - channels.begin());
}

bool JointLog::is_joined_between(double from_s, double to_s) const {
  const auto next = std::ranges::upper_bound(joined_at_s, from_s);
  return next != joined_at_s.end() && *next <= to_s;
}

std::size_t time_column(const CsvTable& table) {
  for (const std::string_view name : {"t", "time", "stamp", "timestamp"}) {
    const auto found = std::ranges::find_if(table.header, [&](const std::string& column) {
      return std::ranges::equal(without_unit(column), name, [](unsigned char a, unsigned char b) {
        return std::tolower(a) == static_cast<int>(b);
      });
    });
    if (found != table.header.end()) return static_cast<std::size_t>(found - table.header.begin());
  }
  return table.require_column("t");
}

TableLog joint_log_of(CsvTable table, const std::vector<std::string>& torque_channels) {
  TableLog read;
  JointLog& log = read.log;
  log.source = table.source;
  const std::vector<std::string> names_in_file = table.header;
  strip_units(table);
  const std::size_t time = time_column(table);
  log.time_column = names_in_file[time];
  const std::vector<std::size_t> columns = channel_columns(table, time, torque_channels, log);
  const std::size_t first = first_whole_row(table, columns);
  if (first > 0) {
    log.warnings.push_back(
        fmt::format("{}: the first {} rows, in which a channel is blank, are "
                    "left out",
                    table.source, first));
  }
  BadRows bad(table);
  read.rows = read_samples(table, time, first, columns, bad, log);
  sort_out_stamps(table, bad, read);
  log.values.conservativeResize(static_cast<Eigen::Index>(log.size()), Eigen::NoChange);
  to_seconds(header_factor(log.time_column), log);
  const std::vector<std::string> left_out = bad.warnings();
  log.warnings.insert(log.warnings.end(), left_out.begin(), left_out.end());
  unwrap_channels(log);
  return read;
}

JointLog read_joint_log(const std::filesystem::path& path,
                        const std::vector<std::string>& torque_channels) {
  return joint_log_of(read_csv(path, RaggedRows::kSetAside), torque_channels).log;
}

JointLog parse_joint_log(std::string_view text, const std::string& source,
                         const std::vector<std::string>& torque_channels) {
  return joint_log_of(parse_csv(text, source, RaggedRows::kSetAside), torque_channels).log;
}

std::optional<ChannelValue> interpolate(const JointLog& log, int channel, double time_s,
                                        double max_gap_s) {
  if (log.empty() || time_s < log.times_s.front() || time_s > log.times_s.back()) {
    return std::nullopt;
  }
  const auto after = std::ranges::upper_bound(log.times_s, time_s);
  const auto before = static_cast<std::size_t>(after - log.times_s.begin()) - 1;
  if (log.times_s[before] == time_s) {
    const auto row = static_cast<Eigen::Index>(before);
    return ChannelValue{log.values(row, channel),
                        log.size() > 1 ? slope(log, channel, before) : 0.0};
  }
  if (log.times_s[before + 1] - log.times_s[before] > max_gap_s) return std::nullopt;
  return hermite(log, channel, before, time_s);
}

Eigen::MatrixXd resample(const JointLog& log, const std::vector<double>& times_s,
                         double time_offset_s, double max_gap_s) {
  return resample_quantity(log, times_s, time_offset_s, max_gap_s, Quantity::kValue);
}

Eigen::MatrixXd resample_rates(const JointLog& log, const std::vector<double>& times_s,
                               double time_offset_s, double max_gap_s) {
  return resample_quantity(log, times_s, time_offset_s, max_gap_s, Quantity::kRate);
}

bool is_stamp(const JointLog& log, double time_s) {
  return std::ranges::binary_search(log.times_s, time_s);
}

bool is_posture_log(const JointLog& log, const std::vector<double>& times_s,
                    const std::vector<int>& channels) {
  const auto stamped = std::ranges::count_if(times_s, [&](double t) { return is_stamp(log, t); });
  return 2 * stamped > std::ssize(times_s) &&
         std::ranges::none_of(channels, [&](int c) { return moves_smoothly(log, c); });
}

}  // namespace kinescope
