// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/exchanged_readings.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/median.h"

namespace kinescope {
namespace {

// More of them are another kind of log.
constexpr std::size_t kMost = 4;
// Of the sharpest turn of the motion. Chosen.
constexpr double kJump = 2.0;
// Of a channel's range: postures in a row cross half of it in one step. Chosen.
constexpr double kFastestOfAMotion = 0.1;

// How a log's channels go on from row to row where their joints only move.
class UsualMotion {
 public:
  explicit UsualMotion(const JointLog& log) {
    std::vector<double> intervals;
    for (std::size_t row = 1; row < log.size(); ++row)
      intervals.push_back(log.times_s[row] - log.times_s[row - 1]);
    interval_s_ = median_of(intervals);
    for (int c = 0; c < log.values.cols(); ++c) {
      std::vector<double> turns;
      std::vector<double> steps;
      for (Eigen::Index row = 2; row < log.values.rows(); ++row) {
        turns.push_back(turn(log, c, row, log.values(row, c)));
        steps.push_back(std::abs(log.values(row, c) - log.values(row - 1, c)));
      }
      const auto column = log.values.col(c);
      const double range = column.maxCoeff() - column.minCoeff();
      sharpest_.push_back(largest_but_of_jumps(turns));
      is_motion_.push_back(sharpest_.back() > 0.0 &&
                           largest_but_of_jumps(steps) < kFastestOfAMotion * range);
    }
  }

  /// How far this is from where the two rows before lead, as of a usual interval where a longer one
  /// lies between.
  [[nodiscard]] double turn(const JointLog& log, int channel, Eigen::Index row,
                            double value) const {
    const auto time_s = [&](Eigen::Index r) { return log.times_s[static_cast<std::size_t>(r)]; };
    const double before = log.values(row - 1, channel);
    const double rate =
        (before - log.values(row - 2, channel)) / (time_s(row - 1) - time_s(row - 2));
    const double step_s = time_s(row) - time_s(row - 1);
    const double intervals = std::max(1.0, step_s / interval_s_);
    return std::abs(value - before - rate * step_s) / (intervals * intervals);
  }

  [[nodiscard]] double sharpest_turn(int channel) const {
    return sharpest_[static_cast<std::size_t>(channel)];
  }
  [[nodiscard]] bool is_motion(int channel) const {
    return is_motion_[static_cast<std::size_t>(channel)];
  }

 private:
  // A jump is two turns, there and on.
  static double largest_but_of_jumps(std::vector<double>& values) {
    std::ranges::nth_element(values, values.begin() + 2 * kMost, std::greater{});
    return values[2 * kMost];
  }

  double interval_s_ = 0.0;
  std::vector<double> sharpest_;
  std::vector<bool> is_motion_;
};

bool jumps(const JointLog& log, const UsualMotion& usual, Eigen::Index row, int channel) {
  return usual.turn(log, channel, row, log.values(row, channel)) >
         kJump * usual.sharpest_turn(channel);
}

// None where they come from a jump: a single wrong reading leads anywhere (one of 0 to the other
// side of zero).
std::vector<int> channels_that_jump(const JointLog& log, const UsualMotion& usual,
                                    Eigen::Index row) {
  std::vector<int> out;
  for (int c = 0; c < log.values.cols(); ++c) {
    if (!usual.is_motion(c) || !jumps(log, usual, row, c)) continue;
    if (jumps(log, usual, row - 1, c)) return {};
    out.push_back(c);
  }
  return out;
}

struct Continued {
  GoesOnAs reading;
  double turn = std::numeric_limits<double>::infinity();
};

Continued nearest_of(const std::vector<int>& columns, const JointLog& log, const UsualMotion& usual,
                     Eigen::Index row, int channel) {
  Continued out;
  for (const int column : columns) {
    for (const double sign : {1.0, -1.0}) {
      const double turn = usual.turn(log, channel, row, sign * log.values(row, column));
      if (turn < out.turn) out = {{channel, column, sign}, turn};
    }
  }
  return out;
}

// Where each of the channels that jump at this row goes on, if each goes on in another's place.
std::optional<ExchangedReadings> exchanged_at(const JointLog& log, const UsualMotion& usual,
                                              Eigen::Index row) {
  const std::vector<int> jump = channels_that_jump(log, usual, row);
  if (jump.empty()) return std::nullopt;
  ExchangedReadings out{static_cast<std::size_t>(row), {}};
  std::set<int> taken;
  for (const int channel : jump) {
    const auto [reading, turn] = nearest_of(jump, log, usual, row, channel);
    const double sharpest =
        std::max(usual.sharpest_turn(channel), usual.sharpest_turn(reading.column));
    if (turn > sharpest || !taken.insert(reading.column).second) return std::nullopt;
    out.readings.push_back(reading);
  }
  return out;
}

void exchange_back(JointLog& log, const ExchangedReadings& exchanged) {
  const auto first = static_cast<Eigen::Index>(exchanged.row);
  const Eigen::Index count = log.values.rows() - first;
  const Eigen::MatrixXd as_logged = log.values.bottomRows(count);
  for (const GoesOnAs& reading : exchanged.readings)
    log.values.col(reading.channel).tail(count) = reading.sign * as_logged.col(reading.column);
}

std::string words_of(const JointLog& log, const GoesOnAs& reading) {
  const auto name = [&](int channel) {
    return fmt::format("'{}'", log.channels[static_cast<std::size_t>(channel)]);
  };
  return fmt::format("{} goes on as {}{}", name(reading.channel), reading.sign < 0.0 ? "-" : "",
                     name(reading.column));
}

}  // namespace

std::vector<ExchangedReadings> exchanged_readings(const JointLog& log,
                                                  const std::vector<ReadingApart>& apart) {
  std::vector<ExchangedReadings> out;
  // Most rows are the motion's.
  constexpr std::size_t kFewestRows = 20 * kMost;
  if (log.size() < kFewestRows) return out;
  JointLog mended = without_readings(log, apart);
  const UsualMotion usual(mended);
  for (std::size_t row = 3; row < log.size(); ++row) {
    if (log.is_joined_between(log.times_s[row - 3], log.times_s[row])) continue;
    const auto found = exchanged_at(mended, usual, static_cast<Eigen::Index>(row));
    if (!found) continue;
    exchange_back(mended, *found);
    out.push_back(*found);
  }
  if (out.size() > kMost) out.clear();
  return out;
}

JointLog with_exchanged_back(JointLog log, const std::vector<ExchangedReadings>& exchanged) {
  for (const ExchangedReadings& one : exchanged) exchange_back(log, one);
  return log;
}

std::string words_of(const JointLog& log, const ExchangedReadings& exchanged) {
  std::vector<std::string> words;
  for (const GoesOnAs& reading : exchanged.readings) words.push_back(words_of(log, reading));
  return fmt::format("{}: from {} = {:.6g} on {}", log.source, log.time_column,
                     log.times_s[exchanged.row], fmt::join(words, ", "));
}

}  // namespace kinescope
