// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/readings_apart.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr int kMostOfAChannel = 3;  // more of them are a motion, or another place
constexpr double kShareOfRange = 0.5;
constexpr Eigen::Index kFewestReadings = 8;
constexpr Eigen::Index kNear = 3;        // readings to either side of one
constexpr std::size_t kMostSpikes = 10;  // one in so many
constexpr std::size_t kFewToldAlone = 3;

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

// From the median of what is read about it.
double away_from_median(const Eigen::VectorXd& column, Eigen::Index row) {
  const Eigen::Index first = std::max<Eigen::Index>(row - kNear, 0);
  const Eigen::Index count = std::min(row + kNear + 1, column.size()) - first;
  const auto about = column.segment(first, count);
  return std::abs(column[row] - median_of({about.begin(), about.end()}));
}

using Rows = std::set<Eigen::Index>;

// A row of the way from one reading to the next, some left out.
double largest_step_without(const Rows& out, const Eigen::VectorXd& column) {
  double largest = 0.0;
  Eigen::Index before = -1;
  for (Eigen::Index row = 0; row < column.size(); ++row) {
    if (out.contains(row)) continue;
    if (before >= 0) {
      const double step = (column[row] - column[before]) / static_cast<double>(row - before);
      largest = std::max(largest, std::abs(step));
    }
    before = row;
  }
  return largest;
}

// Readings from whose median to them no motion leads in as many steps as there are. What the motion
// is like is told by the others: neither by those that are furthest from it nor by doubted rows.
Rows spikes_of(const Eigen::VectorXd& column, const Rows& doubted) {
  struct Away {
    bool is_believed;
    double distance;
    Eigen::Index row;
    bool operator<(const Away& other) const {
      return std::tuple(is_believed, -distance, row) <
             std::tuple(other.is_believed, -other.distance, other.row);
    }
  };
  std::vector<Away> away;
  for (Eigen::Index row = 0; row < column.size(); ++row)
    away.push_back({!doubted.contains(row), away_from_median(column, row), row});
  const std::size_t most = away.size() / kMostSpikes;
  std::ranges::partial_sort(away, away.begin() + static_cast<std::ptrdiff_t>(most), std::less{});
  away.resize(most);
  Rows out;
  for (const Away& reading : away) out.insert(reading.row);
  const double led = static_cast<double>(kNear) * largest_step_without(out, column);
  for (const Away& reading : away)
    if (!(reading.distance > led)) out.erase(reading.row);
  return out;
}

// Rows that are wrong in one channel are the first to be doubted in the others.
void add_spikes(const JointLog& log, std::vector<ReadingApart>& out) {
  constexpr int kPasses = 2;
  Rows doubted;
  std::vector<Rows> spikes(log.channels.size());
  for (int pass = 0; pass < kPasses; ++pass) {
    for (std::size_t c = 0; c < spikes.size(); ++c)
      spikes[c] = spikes_of(log.values.col(static_cast<Eigen::Index>(c)), doubted);
    for (const Rows& rows : spikes) doubted.insert(rows.begin(), rows.end());
  }
  for (std::size_t c = 0; c < spikes.size(); ++c)
    for (const Eigen::Index row : spikes[c])
      out.push_back({static_cast<std::size_t>(row), static_cast<int>(c), true});
}

// A row most of which is wrong is another row altogether, where some of it looks right.
void add_rest_of_rows(const JointLog& log, std::vector<ReadingApart>& out) {
  std::map<std::size_t, std::set<int>> rows;
  for (const ReadingApart& reading : out) rows[reading.row].insert(reading.channel);
  for (const auto& [row, apart] : rows) {
    if (apart.size() < 2 || 2 * apart.size() <= log.channels.size()) continue;
    for (int c = 0; c < log.values.cols(); ++c)
      if (!apart.contains(c)) out.push_back({row, c, true});
  }
}

}  // namespace

std::vector<ReadingApart> readings_apart(const JointLog& log) {
  std::vector<ReadingApart> out;
  if (log.values.rows() < kFewestReadings) return out;
  for (int c = 0; c < log.values.cols(); ++c) add_of_channel(log, c, out);
  add_spikes(log, out);
  add_rest_of_rows(log, out);
  const auto where = [](const ReadingApart& reading) {
    return std::pair{reading.row, reading.channel};
  };
  std::ranges::stable_sort(out, {}, where);
  const auto twice = std::ranges::unique(out, {}, where);
  out.erase(twice.begin(), twice.end());
  return out;
}

std::vector<std::vector<ReadingApart>> told_together(const std::vector<ReadingApart>& apart) {
  std::map<int, std::size_t> count;  // of a channel
  for (const ReadingApart& reading : apart) ++count[reading.channel];
  std::vector<std::vector<ReadingApart>> out;
  std::map<int, std::size_t> group_of;
  for (const ReadingApart& reading : apart) {
    const auto with = group_of.find(reading.channel);
    if (with != group_of.end()) {
      out[with->second].push_back(reading);
      continue;
    }
    if (count[reading.channel] > kFewToldAlone) group_of[reading.channel] = out.size();
    out.push_back({reading});
  }
  return out;
}

std::string words_of(const JointLog& log, std::span<const ReadingApart> readings) {
  const ReadingApart& first = readings.front();
  const double value = log.values(static_cast<Eigen::Index>(first.row), first.channel);
  const std::string& channel = log.channels[static_cast<std::size_t>(first.channel)];
  const double time_s = log.times_s[first.row];
  if (readings.size() > 1) {
    return fmt::format(
        "{}: {} readings of '{}' (the first at {} = {}: {:.6g}) are not near those before and "
        "after",
        log.source, readings.size(), channel, log.time_column, time_s, value);
  }
  return fmt::format("{}: at {} = {} '{}' reads {:.6g}, which {}", log.source, log.time_column,
                     time_s, channel, value,
                     first.in_range ? "the readings before and after do not come near"
                                    : "none of its other readings comes near");
}

JointLog without_readings(JointLog log, const std::vector<ReadingApart>& apart) {
  std::set<std::pair<std::size_t, int>> places;
  for (const ReadingApart& reading : apart) places.emplace(reading.row, reading.channel);
  const auto is_apart = [&](std::size_t row, int channel) {
    return places.contains({row, channel});
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
