// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/partition.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "kinematics/core/stretch_widening.h"

namespace kinescope::trace {
namespace {

constexpr double kCorrelationTimes = 6.0;  // in a stretch
constexpr double kAimedStretches = 24.0;
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
                                   duration / kManyStretches, duration / kAimedStretches);
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

// In the order in which they appear; returns how many there are.
int number_without_gaps(std::vector<int>& groups) {
  std::map<int, int> number;
  for (int& group : groups)
    group = number.try_emplace(group, static_cast<int>(number.size())).first->second;
  return static_cast<int>(number.size());
}

}  // namespace

Partition make_partition(const Linearisation& linear) {
  Partition out;
  out.stretch = stretch_of_instants(linear, out.widening);
  out.stretches = number_without_gaps(out.stretch);
  out.fold = linear.fold;
  out.folds = number_without_gaps(out.fold);
  return out;
}

}  // namespace kinescope::trace
