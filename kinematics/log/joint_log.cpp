// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/joint_log.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"
#include "kinematics/log/unwrap.h"

namespace kinescope {
namespace {

std::size_t time_column(const CsvTable& table) {
  for (const std::string_view name : {"t", "time", "stamp", "timestamp"}) {
    const auto found = std::ranges::find_if(table.header, [&](const std::string& column) {
      return std::ranges::equal(column, name, [](unsigned char a, unsigned char b) {
        return std::tolower(a) == static_cast<int>(b);
      });
    });
    if (found != table.header.end()) return static_cast<std::size_t>(found - table.header.begin());
  }
  return table.require_column("t");
}

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

// The columns of the channels; names them, the torques and what is no channel in `log`.
std::vector<std::size_t> channel_columns(const CsvTable& table, std::size_t time,
                                         const std::vector<std::string>& torque_channels,
                                         JointLog& log) {
  std::vector<std::size_t> columns;
  for (std::size_t c = 0; c < table.header.size(); ++c) {
    const std::string& name = table.header[c];
    if (c == time) continue;
    if (name.starts_with("tau") ||
        std::ranges::find(torque_channels, name) != torque_channels.end()) {
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

JointLog from_table(const CsvTable& table, const std::vector<std::string>& torque_channels) {
  JointLog log;
  log.source = table.source;
  const std::size_t time = time_column(table);
  log.time_column = table.header[time];
  const std::vector<std::size_t> columns = channel_columns(table, time, torque_channels, log);
  const std::size_t first = first_whole_row(table, columns);
  if (first > 0) {
    log.warnings.push_back(
        fmt::format("{}: the first {} rows, in which a channel is blank, are "
                    "left out",
                    table.source, first));
  }
  const auto most = static_cast<Eigen::Index>(table.rows.size() - first);
  log.values.resize(most, static_cast<Eigen::Index>(columns.size()));
  int repeated = 0;
  for (std::size_t r = first; r < table.rows.size(); ++r) {
    const auto row = static_cast<Eigen::Index>(log.size());
    const double time_s = table.number(r, time);
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const double value = table.number(r, columns[c]);
      log.values(row, static_cast<Eigen::Index>(c)) = value;
    }
    if (!log.times_s.empty() && time_s <= log.times_s.back()) {
      if (time_s == log.times_s.back() && log.values.row(row) == log.values.row(row - 1)) {
        ++repeated;
        continue;
      }
      throw bad_input(
          table.place(r),
          fmt::format("time {:.6f} s does not come after {:.6f} s", time_s, log.times_s.back()),
          "sort the rows by time and remove repeated stamps");
    }
    log.times_s.push_back(time_s);
  }
  log.values.conservativeResize(static_cast<Eigen::Index>(log.size()), Eigen::NoChange);
  if (repeated > 0) {
    log.warnings.push_back(
        fmt::format("{}: {} rows repeat the row before and are left out", table.source, repeated));
  }
  unwrap_channels(log);
  return log;
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
  const auto found = std::ranges::find(channels, name);
  if (found == channels.end()) return std::nullopt;
  return static_cast<int>(found - channels.begin());
}

JointLog read_joint_log(const std::filesystem::path& path,
                        const std::vector<std::string>& torque_channels) {
  return from_table(read_csv(path), torque_channels);
}

JointLog parse_joint_log(std::string_view text, const std::string& source,
                         const std::vector<std::string>& torque_channels) {
  return from_table(parse_csv(text, source), torque_channels);
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

bool is_posture_log(const JointLog& log, const std::vector<double>& times_s,
                    const std::vector<int>& channels) {
  return std::ranges::all_of(
             times_s, [&](double t) { return std::ranges::binary_search(log.times_s, t); }) &&
         std::ranges::none_of(channels, [&](int c) { return moves_smoothly(log, c); });
}

}  // namespace kinescope
