// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/readings_apart.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

namespace kinescope {
namespace {

constexpr int kMostOfAChannel = 3;  // more of them are a motion, or another place
constexpr double kShareOfRange = 0.5;
constexpr Eigen::Index kFewestReadings = 8;

void add_of_channel(const JointLog& log, int channel, std::vector<ReadingApart>& out) {
  const auto column = log.values.col(channel);
  std::vector<std::size_t> order(static_cast<std::size_t>(column.size()));
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto value = [&](std::size_t row) { return column[static_cast<Eigen::Index>(row)]; };
  std::ranges::stable_sort(order, {}, value);
  std::size_t first = 0;
  std::size_t last = order.size() - 1;
  for (int k = 0; k < kMostOfAChannel; ++k) {
    const double range = value(order[last]) - value(order[first]);
    if (!(range > 0.0)) return;
    const double below = value(order[first + 1]) - value(order[first]);
    const double above = value(order[last]) - value(order[last - 1]);
    if (std::max(below, above) < kShareOfRange * range) return;
    out.push_back({above >= below ? order[last--] : order[first++], channel});
  }
}

}  // namespace

std::vector<ReadingApart> readings_apart(const JointLog& log) {
  std::vector<ReadingApart> out;
  if (log.values.rows() < kFewestReadings) return out;
  for (int c = 0; c < log.values.cols(); ++c) add_of_channel(log, c, out);
  std::ranges::stable_sort(out, {}, &ReadingApart::row);
  return out;
}

std::string words_of(const JointLog& log, const ReadingApart& reading) {
  return fmt::format(
      "{}: at {} = {} '{}' reads {:.6g}, which none of its other readings comes near", log.source,
      log.time_column, log.times_s[reading.row],
      log.channels[static_cast<std::size_t>(reading.channel)],
      log.values(static_cast<Eigen::Index>(reading.row), reading.channel));
}

JointLog without_readings(JointLog log, const std::vector<ReadingApart>& apart) {
  const auto is_apart = [&](std::size_t row, int channel) {
    return std::ranges::any_of(apart, [&](const ReadingApart& reading) {
      return reading.row == row && reading.channel == channel;
    });
  };
  for (const ReadingApart& reading : apart) {
    std::size_t before = reading.row;
    std::size_t after = reading.row;
    while (before > 0 && is_apart(before, reading.channel)) --before;
    while (after + 1 < log.size() && is_apart(after, reading.channel)) ++after;
    if (is_apart(before, reading.channel)) before = after;
    if (is_apart(after, reading.channel)) after = before;
    const auto value = [&](std::size_t row) {
      return log.values(static_cast<Eigen::Index>(row), reading.channel);
    };
    const double step = log.times_s[after] - log.times_s[before];
    const double share = step > 0.0 ? (log.times_s[reading.row] - log.times_s[before]) / step : 0.0;
    log.values(static_cast<Eigen::Index>(reading.row), reading.channel) =
        (1.0 - share) * value(before) + share * value(after);
  }
  return log;
}

}  // namespace kinescope
