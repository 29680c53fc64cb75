// SPDX-License-Identifier: Apache-2.0
//
// Torque readings that are recognised by what they repeat: a limit, the last value of a sensor that
// froze, the zero of a dead zone.
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "dynamics/data/channel.h"
#include "dynamics/data/log_checks.h"
#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kSpeedReachS = 0.025;  // chosen: either way, longer than an encoder's steps last
// Of the joint's rms speed, that its speed varies by while its torque stays the same: at constant
// speed friction may be all of the torque. Chosen.
constexpr double kVaries = 0.25;
constexpr double kMoves = 0.05;      // chosen: of the rms speed; slower, a joint may be at rest
constexpr double kFarLonger = 10.0;  // chosen: times all shorter runs of one value
// A value that was held moves on at once when it is renewed: times its usual change, and times the
// change with which the run began. A torque that is commanded to stay began with a step.
constexpr double kCatchesUp = 3.0;
constexpr std::size_t kFewest = 30;   // of zeros, and values beside the band: chance is 2^-30
constexpr double kInBand = 0.01;      // chosen: of the zeros, that may be within the band
constexpr double kLeastZeros = 0.25;  // chosen: of the values in one band width beside the band
/// Beyond this share of the rows, other joints lose more than such readings take: their error is
/// that of the band.
constexpr double kMostZeros = 0.5;

/// Of a row: `kLost` says nothing, `kLimit` that the torque is at least so large.
enum Mark : char { kSound, kLost, kLimit };

/// Rows [begin, end) of one trajectory.
struct ValueRun {
  Eigen::Index begin = 0, end = 0;
  [[nodiscard]] Eigen::Index rows() const { return end - begin; }
};

/// One joint's torque as it was read.
struct Reading {
  const TorqueLog& log;
  Eigen::Index joint = 0;
  Channel channel;
  Eigen::VectorXd speed;   ///< smoothed, of each row
  double rms_speed = 0.0;  ///< rad/s or m/s

  [[nodiscard]] double at(Eigen::Index row) const { return log.torque(row, joint); }
  [[nodiscard]] bool moves(Eigen::Index row) const {
    return std::abs(speed(row)) >= kMoves * rms_speed;
  }
  /// The speed is not the same all the while.
  [[nodiscard]] bool varies(const std::vector<double>& speeds) const {
    return quantile(speeds, 0.95) - quantile(speeds, 0.05) >= kVaries * rms_speed;
  }
  [[nodiscard]] std::string column() const { return fmt::format("column '{}'", channel.name); }
  [[nodiscard]] std::string value(double torque) const {
    const bool slides = log.joints[static_cast<std::size_t>(joint)].prismatic;
    return fmt::format("{:.4g} {}", torque,
                       slides && log.torque_unit == "Nm" ? "N" : log.torque_unit);
  }
  [[nodiscard]] std::string name() const {
    return log.joints[static_cast<std::size_t>(joint)].name;
  }
  [[nodiscard]] LogFinding finding(LogFault fault, Eigen::Index rows, Eigen::Index first,
                                   double size, std::string what, std::string remedy) const {
    return {fault, FaultWeight::kWarning, channel.name,    share_of(rows, log.rows()),
            size,  log.place(first),      std::move(what), std::move(remedy)};
  }
};

Eigen::VectorXd smoothed_speed(const TorqueLog& log, Eigen::Index joint) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(log.rows());
  for (Eigen::Index row = 0; const RowWindow& window : windows_around_rows(log, kSpeedReachS)) {
    const double span_s = log.t_s(window.to) - log.t_s(window.from);
    if (span_s > 0.0) out(row) = (log.q(window.to, joint) - log.q(window.from, joint)) / span_s;
    ++row;
  }
  return out;
}

/// Runs of one and the same value, without rows that are marked by now.
std::vector<ValueRun> runs_of(const Reading& reading, const std::vector<char>& marked) {
  std::vector<ValueRun> out;
  const TorqueLog& log = reading.log;
  for (Eigen::Index row = 0; row < log.rows(); ++row) {
    if (marked[static_cast<std::size_t>(row)] != 0) continue;
    const bool goes_on = !out.empty() && out.back().end == row &&
                         log.trajectory(row) == log.trajectory(row - 1) &&
                         reading.at(row) == reading.at(row - 1);
    if (!goes_on) out.push_back({row, row});
    out.back().end = row + 1;
  }
  return out;
}

void leave_out_limits(const Reading& reading, std::vector<char>& marked,
                      std::vector<LogFinding>& findings) {
  const TorqueLog& log = reading.log;
  for (const auto& [limit, clipping] : clipped_ends(reading.channel)) {
    std::vector<Eigen::Index> rows;
    std::vector<double> speeds;
    for (Eigen::Index row = 0; row < log.rows(); ++row) {
      if (reading.at(row) != limit) continue;
      rows.push_back(row);
      speeds.push_back(reading.speed(row));
    }
    const bool certain = reading.varies(speeds);
    if (certain) {
      for (const Eigen::Index row : rows) marked[static_cast<std::size_t>(row)] = kLimit;
    }
    findings.push_back(reading.finding(
        LogFault::kClipped, clipping.rows, clipping.first, limit,
        fmt::format("{} is cut off at {} in {} rows ({:.2g} %), {} times", reading.column(),
                    reading.value(limit), clipping.rows,
                    100.0 * share_of(clipping.rows, log.rows()), clipping.runs),
        certain ? "these readings are left out; move less hard, or record with a larger range"
                : "leave the motion that saturates it out, or record with a larger range"));
  }
}

/// Half the width of the band in which the torque reads 0; none where there is no such band.
std::optional<double> dead_band(const Reading& reading) {
  const TorqueLog& log = reading.log;
  std::vector<double> sizes;
  std::size_t zeros = 0, edges = 0, near_edges = 0;
  std::vector<double> beside;  // sizes of what stands next to zeros
  for (Eigen::Index row = 0; row < log.rows(); ++row) {
    if (!reading.moves(row)) continue;
    const double size = std::abs(reading.at(row));
    if (size == 0.0)
      ++zeros;
    else
      sizes.push_back(size);
    const bool edge = row > 0 && log.trajectory(row) == log.trajectory(row - 1) &&
                      (size == 0.0) != (reading.at(row - 1) == 0.0);
    if (edge) beside.push_back(std::max(size, std::abs(reading.at(row - 1))));
  }
  if (zeros < kFewest || sizes.empty()) return std::nullopt;
  std::ranges::sort(sizes);
  const auto inside = static_cast<std::size_t>(kInBand * static_cast<double>(zeros));
  const double band = sizes[std::min(inside, sizes.size() - 1)];
  const auto first = std::ranges::lower_bound(sizes, band);
  const auto end = std::ranges::upper_bound(sizes, 2.0 * band);
  std::vector<double> near(first, end);
  const auto repeats = std::ranges::unique(near);
  const auto values = static_cast<std::size_t>(std::distance(near.begin(), repeats.begin()));
  edges = beside.size();
  near_edges = static_cast<std::size_t>(
      std::ranges::count_if(beside, [&](double size) { return size <= 2.0 * band; }));
  const bool dense = values >= kFewest &&
                     static_cast<double>(zeros) >= kLeastZeros * static_cast<double>(near.size());
  if (!dense || 2 * near_edges < edges) return std::nullopt;
  return band;
}

void leave_out_dead_zone(const Reading& reading, std::vector<char>& marked,
                         std::vector<LogFinding>& findings) {
  const std::optional<double> band = dead_band(reading);
  if (!band) return;
  const TorqueLog& log = reading.log;
  std::vector<Eigen::Index> rows;
  for (Eigen::Index row = 0; row < log.rows(); ++row)
    if (reading.at(row) == 0.0) rows.push_back(row);
  const double share = share_of(std::ssize(rows), log.rows());
  const bool few = share <= kMostZeros;
  if (few) {
    for (const Eigen::Index row : rows) marked[static_cast<std::size_t>(row)] = kLost;
  }
  findings.push_back(reading.finding(
      LogFault::kDeadZone, std::ssize(rows), rows.front(), *band,
      fmt::format("{} reads exactly 0 in {} rows ({:.2g} %) and nothing else below {} while {} "
                  "moves: a dead zone",
                  reading.column(), rows.size(), 100.0 * share, reading.value(*band),
                  reading.name()),
      few ? "these readings are left out: they only say that the torque is less; log the current "
            "without a dead zone"
          : "they are too many to be left out and are used as they are; log the current without a "
            "dead zone"));
}

/// Length beyond which runs of one value are far longer than all others; none where there is none.
std::optional<Eigen::Index> usual_length(const std::vector<ValueRun>& runs) {
  std::vector<Eigen::Index> lengths;
  lengths.reserve(runs.size());
  for (const ValueRun& run : runs) lengths.push_back(run.rows());
  std::ranges::sort(lengths);
  for (std::size_t k = 1; k < lengths.size(); ++k) {
    if (static_cast<double>(lengths[k]) >= kFarLonger * static_cast<double>(lengths[k - 1]))
      return lengths[k - 1];
  }
  return std::nullopt;
}

/// The joint moves in most of it, and its speed changes.
bool is_in_motion(const Reading& reading, const ValueRun& run) {
  std::vector<double> speeds;
  Eigen::Index moving = 0;
  for (Eigen::Index row = run.begin; row < run.end; ++row) {
    speeds.push_back(reading.speed(row));
    if (reading.moves(row)) ++moving;
  }
  return 2 * moving >= run.rows() && reading.varies(speeds);
}

bool catches_up(const Reading& reading, const ValueRun& run) {
  const TorqueLog& log = reading.log;
  const auto change = [&](Eigen::Index row) {
    const bool inside =
        row > 0 && row < log.rows() && log.trajectory(row) == log.trajectory(row - 1);
    return inside ? std::optional(std::abs(reading.at(row) - reading.at(row - 1))) : std::nullopt;
  };
  const std::optional<double> after = change(run.end);
  const double before = change(run.begin).value_or(0.0);
  return !after || *after >= kCatchesUp * std::max(usual_change(reading.channel), before);
}

void leave_out_frozen(const Reading& reading, std::vector<char>& marked,
                      std::vector<LogFinding>& findings) {
  const TorqueLog& log = reading.log;
  std::vector<ValueRun> frozen = runs_of(reading, marked);
  const std::optional<Eigen::Index> usual = usual_length(frozen);
  if (!usual) return;
  std::erase_if(frozen, [&](const ValueRun& run) {
    return run.rows() <= *usual || !is_in_motion(reading, run);
  });
  const std::size_t kept_values = frozen.size();
  std::erase_if(frozen, [&](const ValueRun& run) { return !catches_up(reading, run); });
  // Where most do not, values are kept as a rule: one that catches up does so by chance.
  if (frozen.empty() || 2 * frozen.size() < kept_values) return;
  Eigen::Index rows = 0;
  for (const ValueRun& run : frozen) {
    std::fill(marked.begin() + run.begin, marked.begin() + run.end, static_cast<char>(kLost));
    rows += run.rows();
  }
  const ValueRun& longest = *std::ranges::max_element(frozen, {}, &ValueRun::rows);
  const std::string times =
      frozen.size() == 1 ? std::string() : fmt::format(", and {} times more", frozen.size() - 1);
  findings.push_back(reading.finding(
      LogFault::kFrozen, rows, longest.begin, log.t_s(longest.end - 1) - log.t_s(longest.begin),
      fmt::format("{} keeps the value {} from {:.2f} to {:.2f} s while {} moves{}",
                  reading.column(), reading.value(reading.at(longest.begin)),
                  log.t_s(longest.begin), log.t_s(longest.end - 1), reading.name(), times),
      "these readings are left out; look after the sensor and what reads it"));
}

/// A straight line over what is lost; the nearest reading at a trajectory's ends.
void bridge(const std::vector<char>& marked, Eigen::Index joint, TorqueLog& log) {
  const std::vector<Eigen::Index> bounds = log.bounds();
  const auto is_marked = [&](Eigen::Index row) {
    return marked[static_cast<std::size_t>(row)] == kLost;
  };
  for (std::size_t b = 0; b + 1 < bounds.size(); ++b) {
    for (Eigen::Index row = bounds[b]; row < bounds[b + 1]; ++row) {
      if (!is_marked(row)) continue;
      Eigen::Index end = row;
      while (end < bounds[b + 1] && is_marked(end)) ++end;
      const bool before = row > bounds[b];
      const bool behind = end < bounds[b + 1];
      const double from =
          before ? log.torque(row - 1, joint) : log.torque(behind ? end : row, joint);
      const double to = behind ? log.torque(end, joint) : from;
      const double begin_s = log.t_s(before ? row - 1 : row);
      const double span_s = log.t_s(behind ? end : end - 1) - begin_s;
      for (; row < end; ++row) {
        const double share = span_s > 0.0 ? (log.t_s(row) - begin_s) / span_s : 0.0;
        log.torque(row, joint) = (1.0 - share) * from + share * to;
      }
    }
  }
}

}  // namespace

CheckedLog check_readings(TorqueLog log) {
  CheckedLog out;
  std::vector<std::vector<char>> marked;
  for (Eigen::Index j = 0; j < log.torque.cols(); ++j) {
    const std::string& name = log.torque_columns[static_cast<std::size_t>(j)];
    std::vector<char>& own = marked.emplace_back(static_cast<std::size_t>(log.rows()), 0);
    Reading reading{.log = log,
                    .joint = j,
                    .channel = look_at(log, log.torque.col(j), name),
                    .speed = smoothed_speed(log, j)};
    reading.rms_speed = reading.speed.norm() / std::sqrt(static_cast<double>(log.rows()));
    const bool moves = standard_deviation(log.q.col(j)) > kStillSpread;
    if (reading.channel.sigma == 0.0) continue;
    leave_out_limits(reading, own, out.findings);
    if (!moves) continue;
    leave_out_dead_zone(reading, own, out.findings);
    leave_out_frozen(reading, own, out.findings);
  }
  for (std::size_t j = 0; j < marked.size(); ++j) {
    const auto column = static_cast<Eigen::Index>(j);
    if (std::ranges::count(marked[j], char{kSound}) == log.rows()) continue;
    if (log.torque_missing.size() == 0)
      log.torque_missing = MissingTorque::Constant(log.rows(), log.torque.cols(), false);
    for (Eigen::Index row = 0; row < log.rows(); ++row)
      log.torque_missing(row, column) = marked[j][static_cast<std::size_t>(row)] != 0;
    bridge(marked[j], column, log);
  }
  out.log = std::move(log);
  return out;
}

}  // namespace kinescope
