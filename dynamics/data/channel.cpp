// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/channel.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "dynamics/data/log_checks.h"
#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr Eigen::Index kClippedRun = 3;  // rows at the limit; a turning point has one or two
constexpr int kClippedRuns = 2;
constexpr double kEntryJump = 3.0;  // change on entering the limit, in steps of the channel
constexpr double kEntryChange =
    0.25;  // the same, in usual changes: a turning point slows down first
constexpr std::size_t kFewLevels =
    20;  // a channel of fewer has its ends often without being cut off

Clipping clipping_at(const Channel& channel, double limit) {
  Clipping out;
  const double usual =
      std::max(kEntryChange * usual_change(channel), kEntryJump * channel.step.value_or(0.0));
  const auto count = static_cast<Eigen::Index>(channel.values.size());
  const auto at = [&](Eigen::Index row) { return channel.values[static_cast<std::size_t>(row)]; };
  for (Eigen::Index row = 1; row < count; ++row) {
    if (at(row) != limit || at(row - 1) == limit) continue;
    Eigen::Index end = row;
    while (end < count && at(end) == limit) ++end;
    const bool fast = std::abs(at(row) - at(row - 1)) >= usual ||
                      (end < count && std::abs(at(end) - limit) >= usual);
    if (end - row < kClippedRun || !fast) continue;
    if (out.runs++ == 0) out.first = row;
    out.rows += end - row;
  }
  return out;
}

}  // namespace

double standard_deviation(const Eigen::VectorXd& x) {
  return std::sqrt((x.array() - x.mean()).square().mean());
}

Channel look_at(const TorqueLog& log, const Eigen::VectorXd& x, const std::string& name) {
  Channel channel;
  channel.name = name;
  channel.values = to_vector(x);
  // The mean of equal numbers need not be exactly theirs.
  const bool constant = x.size() > 0 && x.maxCoeff() == x.minCoeff();
  channel.sigma = constant ? 0.0 : standard_deviation(x);
  for (Eigen::Index row = 1; row < x.size(); ++row) {
    if (log.trajectory(row) == log.trajectory(row - 1)) {
      channel.changes.push_back(std::abs(x(row) - x(row - 1)));
    }
  }
  channel.step = grid_step(channel.values);
  return channel;
}

std::vector<RowWindow> windows_around_rows(const TorqueLog& log, double reach_s) {
  const double step_s = median_of(steps_of(log.t_s, log.trajectory));
  const Eigen::Index reach =
      step_s > 0.0 ? std::max<Eigen::Index>(1, std::lround(reach_s / step_s)) : 1;
  std::vector<RowWindow> out;
  const std::vector<Eigen::Index> bounds = log.bounds();
  for (std::size_t b = 0; b + 1 < bounds.size(); ++b) {
    for (Eigen::Index row = bounds[b]; row < bounds[b + 1]; ++row)
      out.push_back({std::max(bounds[b], row - reach), std::min(bounds[b + 1] - 1, row + reach)});
  }
  return out;
}

double usual_change(const Channel& channel) {
  std::vector<double> changes;
  std::ranges::copy_if(channel.changes, std::back_inserter(changes),
                       [](double change) { return change > 0.0; });
  return median_of(std::move(changes));
}

std::size_t distinct_values(const Channel& channel) {
  return std::set<double>(channel.values.begin(), channel.values.end()).size();
}

std::vector<ClippedEnd> clipped_ends(const Channel& channel) {
  std::vector<ClippedEnd> out;
  if (distinct_values(channel) < kFewLevels) return out;
  const auto [low, high] = std::ranges::minmax(channel.values);
  for (const double limit : {low, high}) {
    const Clipping clipping = clipping_at(channel, limit);
    if (clipping.runs >= kClippedRuns) out.push_back({limit, clipping});
  }
  return out;
}

}  // namespace kinescope
