// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/partition.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "kinematics/core/stretch_widening.h"

namespace kinescope::trace {
namespace {

constexpr double kCorrelationTimes = 6.0;  // in a stretch
constexpr double kFewStretches = 24.0;
constexpr double kManyStretches = 64.0;

std::vector<int> stretch_of_instants(const Linearisation& linear, double& widening) {
  const Eigen::Index n = linear.instants();
  std::vector<int> out(static_cast<std::size_t>(n), 0);
  if (n == 0) return out;
  const double begin = linear.time_s[0];
  const double duration = linear.time_s[n - 1] - begin;
  if (linear.independent_instants || !(duration > 0.0)) {
    const double most = std::min(static_cast<double>(n), kManyStretches);
    for (Eigen::Index i = 0; i < n; ++i) {
      out[static_cast<std::size_t>(i)] =
          static_cast<int>(static_cast<double>(i) * most / static_cast<double>(n));
    }
    return out;
  }
  const double length = std::clamp(kCorrelationTimes * linear.correlation_time_s,
                                   duration / kManyStretches, duration / kFewStretches);
  // Half a step is the integral time of white noise.
  const double step = duration / static_cast<double>(n - 1);
  widening = stretch_widening(length, linear.correlation_time_s - 0.5 * step);
  const int last = std::max(0, static_cast<int>(std::ceil(duration / length - 1e-9)) - 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    out[static_cast<std::size_t>(i)] =
        std::min(last, static_cast<int>((linear.time_s[i] - begin) / length));
  }
  return out;
}

}  // namespace

Partition make_partition(const Linearisation& linear) {
  Partition out;
  const std::vector<int> stretch = stretch_of_instants(linear, out.widening);
  std::map<std::pair<int, int>, int> number;
  std::map<int, int> stretches;
  std::map<int, int> folds;
  for (std::size_t i = 0; i < stretch.size(); ++i) {
    // Numbered without gaps: a stretch without an instant is none.
    const int s =
        stretches.try_emplace(stretch[i], static_cast<int>(stretches.size())).first->second;
    const int f = folds.try_emplace(linear.fold[i], static_cast<int>(folds.size())).first->second;
    const auto [entry, fresh] = number.try_emplace({s, f}, static_cast<int>(out.cells.size()));
    if (fresh) out.cells.push_back({s, f});
    out.cell.push_back(entry->second);
  }
  out.stretches = static_cast<int>(stretches.size());
  out.folds = static_cast<int>(folds.size());
  return out;
}

}  // namespace kinescope::trace
