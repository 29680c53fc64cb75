// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/noise_reference.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "dynamics/data/cutoff.h"
#include "kinematics/core/median.h"

namespace kinescope::effects {
namespace {

constexpr std::size_t kFewest = 30;

/// Instants whose neighbours are one usual step away.
struct Triples {
  std::vector<Eigen::Index> middle;
  double step_s = 0.0;
};

Triples triples_of(const EffectMotion& motion) {
  const std::vector<Eigen::Index>& kept = motion.kept();
  std::vector<double> strides, steps;
  for (std::size_t i = 1; i < kept.size(); ++i) {
    strides.push_back(static_cast<double>(kept[i] - kept[i - 1]));
    steps.push_back(motion.time_s()[kept[i]] - motion.time_s()[kept[i - 1]]);
  }
  Triples out;
  out.step_s = median_of(std::move(steps));
  const auto stride = static_cast<Eigen::Index>(median_of(std::move(strides)));
  const Eigen::VectorXi& trajectory = motion.samples().trajectory;
  for (std::size_t i = 1; i + 1 < kept.size(); ++i) {
    const Eigen::Index before = kept[i - 1], after = kept[i + 1];
    if (kept[i] - before == stride && after - kept[i] == stride &&
        trajectory[before] == trajectory[after])
      out.middle.push_back(static_cast<Eigen::Index>(i));
  }
  return out;
}

/// rms of the noise over that of its second differences over `step_s`.
double noise_over_differences(const EffectMotion& motion, double step_s) {
  constexpr int kFrequencies = 400;
  constexpr double kInstantsACutoff = 4.0;
  constexpr double kReach = 3.0;  // cut-offs: beyond, nothing is left
  const bool filtered = motion.filter().cutoff_hz > 0.0;
  const double cutoff_hz = filtered ? motion.filter().cutoff_hz : 1.0 / (kInstantsACutoff * step_s);
  const double highest_hz = filtered ? kReach * cutoff_hz : 0.5 / step_s;
  double noise = 0.0, differences = 0.0;
  for (int k = 0; k < kFrequencies; ++k) {
    const double f = highest_hz * (k + 0.5) / kFrequencies;
    const double response = filtered ? filter_response(f, cutoff_hz, motion.filter_order()) : 1.0;
    const double corner = f / (0.5 * cutoff_hz);
    const double power = response * response / (1.0 + corner * corner);
    noise += power;
    differences += power * std::pow(2.0 * std::sin(std::numbers::pi * f * step_s), 4);
  }
  return std::sqrt(noise / differences);
}

}  // namespace

Eigen::VectorXd noise_at_most(const EffectMotion& motion, const Eigen::MatrixXd& residual,
                              const Eigen::VectorXd& sigma) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(residual.cols());
  const Triples triples = triples_of(motion);
  if (triples.middle.size() < kFewest || !(triples.step_s > 0.0)) return out;
  const double factor = noise_over_differences(motion, triples.step_s);
  for (Eigen::Index j = 0; j < residual.cols(); ++j) {
    std::vector<double> sizes;
    for (const Eigen::Index i : triples.middle)
      sizes.push_back(std::abs(residual(i - 1, j) - 2.0 * residual(i, j) + residual(i + 1, j)));
    const double rounding =
        motion.samples().torque_step.size() > j ? motion.samples().torque_step[j] / sigma[j] : 0.0;
    out[j] = std::hypot(factor * kSigmaOverMedian * median_of(std::move(sizes)),
                        rounding / std::sqrt(12.0));
  }
  return out;
}

}  // namespace kinescope::effects
