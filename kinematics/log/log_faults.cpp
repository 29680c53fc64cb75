// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/log_faults.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr Eigen::Index kBeside = 5;  // rows on either side of a gap that say how fast it is there
constexpr double kFewSteps = 3.0;
constexpr double kAlike = 0.5;       // of a speed: how far that behind a gap may differ from it
constexpr double kManySteps = 10.0;  // a gap as long would show in the position many times over

// Of a column from row to row, motion and noise together.
double usual_step(const JointLog& log, Eigen::Index channel) {
  std::vector<double> steps;
  for (Eigen::Index row = 1; row < log.values.rows(); ++row) {
    steps.push_back(std::abs(log.values(row, channel) - log.values(row - 1, channel)));
  }
  return median_of(std::move(steps));
}

double mean_rate(const JointLog& log, Eigen::Index channel, Eigen::Index first, Eigen::Index last) {
  const double seconds =
      log.times_s[static_cast<std::size_t>(last)] - log.times_s[static_cast<std::size_t>(first)];
  return (log.values(last, channel) - log.values(first, channel)) / seconds;
}

// Of the gap behind `row`, were it one of time only.
bool goes_on(const JointLog& log, Eigen::Index row, double step_s) {
  bool fast = false;
  for (Eigen::Index c = 0; c < log.values.cols(); ++c) {
    const double before = mean_rate(log, c, row - kBeside, row);
    const double behind = mean_rate(log, c, row + 1, row + 1 + kBeside);
    const double moved = std::abs(log.values(row + 1, c) - log.values(row, c));
    const double speed = std::max(std::abs(before), std::abs(behind));
    // Near a turning point the speed is that of the noise.
    if (moved > kFewSteps * std::max(speed * step_s, usual_step(log, c))) return false;
    const bool alike = std::abs(behind - before) < kAlike * std::abs(before);
    // Noise has speeds, too, but not the same ones twice over the rows beside.
    const double range = log.values.col(c).maxCoeff() - log.values.col(c).minCoeff();
    constexpr double kClearly = 0.01;
    fast = fast || (alike && speed * kManySteps * step_s > kClearly * range);
  }
  return fast;
}

}  // namespace

std::vector<RepeatedStretch> repeated_stretches(const JointLog& log, double shortest_s) {
  std::vector<RepeatedStretch> out;
  const Eigen::Index rows = log.values.rows();
  Eigen::Index first = 0;
  for (Eigen::Index row = 1; row <= rows; ++row) {
    if (row < rows && log.values.row(row) == log.values.row(first)) continue;
    const RepeatedStretch stretch{log.times_s[static_cast<std::size_t>(first)],
                                  log.times_s[static_cast<std::size_t>(row - 1)]};
    const bool all = first == 0 && row == rows;
    if (!all && row - first > 2 && stretch.to_s - stretch.from_s >= shortest_s) {
      out.push_back(stretch);
    }
    first = row;
  }
  return out;
}

JointLog without_stretches(JointLog log, const std::vector<RepeatedStretch>& stretches) {
  std::vector<Eigen::Index> kept;
  std::vector<double> times_s;
  for (std::size_t i = 0; i < log.size(); ++i) {
    const double t = log.times_s[i];
    const bool inside = std::ranges::any_of(stretches, [&](const RepeatedStretch& stretch) {
      return t > stretch.from_s && t < stretch.to_s;
    });
    if (inside) continue;
    kept.push_back(static_cast<Eigen::Index>(i));
    times_s.push_back(t);
  }
  log.values = log.values(kept, Eigen::all).eval();
  log.times_s = std::move(times_s);
  return log;
}

std::vector<ClockJump> clock_jumps(const JointLog& log) {
  std::vector<ClockJump> out;
  const Eigen::Index rows = log.values.rows();
  if (rows < 2 * kBeside + 2) return out;
  std::vector<double> steps;
  for (std::size_t i = 1; i < log.size(); ++i) {
    steps.push_back(log.times_s[i] - log.times_s[i - 1]);
  }
  const double step_s = median_of(steps);
  for (Eigen::Index row = kBeside; row + 1 + kBeside < rows; ++row) {
    const double gap_s = steps[static_cast<std::size_t>(row)];
    if (gap_s <= std::max(0.5 * kMaxGap, kManySteps * step_s)) continue;
    const double* stamps = log.times_s.data() + row;
    if (log.is_joined_between(stamps[0], stamps[1])) continue;
    if (!goes_on(log, row, step_s)) continue;
    out.push_back({log.times_s[static_cast<std::size_t>(row)], gap_s - step_s});
  }
  return out;
}

}  // namespace kinescope
