// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/turned_torques.h"

#include <algorithm>
#include <cmath>

#include "dynamics/data/splits.h"
#include "dynamics/models/torque_model.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr int kMostSamples = 1000;

TorqueSamples with_turned(TorqueSamples samples, const std::vector<int>& joints) {
  for (const int joint : joints) samples.torque.col(joint) *= -1.0;
  return samples;
}

struct LogLikelihood {
  double of_a_sample = 0.0;
  double samples = 0.0;  // independent ones
};

LogLikelihood log_likelihood(const DynamicModel& model, const TorqueSamples& samples,
                             const IdentifyOptions& options) {
  const Identification found = identify_dynamics(model, samples, options);
  LogLikelihood out;
  for (const double sigma : found.sigma) {
    if (sigma > 0.0) out.of_a_sample -= std::log(sigma);
  }
  out.samples = static_cast<double>(samples.size()) / std::max(1.0, found.correlation_samples);
  return out;
}

TorqueSamples some_of(const TorqueSamples& samples) {
  return select_rows(samples, evenly_chosen(samples.size(), kMostSamples));
}

double gain(const LogLikelihood& turned, const LogLikelihood& as_logged) {
  return (turned.of_a_sample - as_logged.of_a_sample) * std::min(turned.samples, as_logged.samples);
}

std::vector<int> turned_in(const DynamicModel& model, const TorqueSamples& samples,
                           const IdentifyOptions& options) {
  const auto joints = static_cast<int>(samples.joints());
  std::vector<int> turned;
  LogLikelihood now = log_likelihood(model, samples, options);
  while (2 * (std::ssize(turned) + 1) < joints) {
    int best = -1;
    LogLikelihood better;
    double most = clear_evidence(joints);
    for (int j = 0; j < joints; ++j) {
      if (std::ranges::count(turned, j) > 0) continue;
      std::vector<int> more = turned;
      more.push_back(j);
      const LogLikelihood other = log_likelihood(model, with_turned(samples, more), options);
      if (gain(other, now) <= most) continue;
      most = gain(other, now);
      best = j;
      better = other;
    }
    if (best < 0) break;
    turned.push_back(best);
    now = better;
  }
  std::ranges::sort(turned);
  return turned;
}

}  // namespace

double clear_evidence(Eigen::Index joints) {
  constexpr double kChance = 1e-3;
  return std::log(static_cast<double>(std::max<Eigen::Index>(1, joints)) / kChance);
}

double evidence_of_turning(const DynamicModel& model, const TorqueSamples& samples,
                           const IdentifyOptions& options, const std::vector<int>& joints) {
  const TorqueSamples few = some_of(samples);
  return gain(log_likelihood(model, with_turned(few, joints), options),
              log_likelihood(model, few, options));
}

std::vector<int> find_turned_torques(const DynamicModel& model, const TorqueSamples& samples,
                                     const IdentifyOptions& options) {
  if (samples.joints() < 2) return {};
  try {
    return turned_in(model, some_of(samples), options);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return {};
  }
}

}  // namespace kinescope
