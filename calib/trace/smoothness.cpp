// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/smoothness.h"

#include <algorithm>
#include <cmath>

namespace kinescope::trace {
namespace {

constexpr double kLeast = -3.0;  // decades of the natural scale
constexpr double kRange = 12.0;

}  // namespace

SmoothnessChoice likeliest_smoothness(const std::vector<Smoothness>& all, double noise,
                                      double decades) {
  SmoothnessChoice best;
  for (const Smoothness& s : all) {
    const double natural =
        noise * static_cast<double>(s.shown.size()) / std::max(1e-300, s.shown.sum());
    for (int v = 0; v * decades <= kRange; ++v) {
      const double variance = natural * std::pow(10.0, kLeast + decades * v);
      const Eigen::ArrayXd gain = 1.0 + variance / noise * s.shown.array();
      const double log_evidence =
          0.5 * (variance / (noise * noise) * s.score.array().square() / gain).sum() -
          0.5 * gain.log().sum();
      if (log_evidence > best.log_evidence) best = {&s, variance, log_evidence};
    }
  }
  return best;
}

Eigen::VectorXd mean_of(const SmoothnessChoice& choice, double noise) {
  return choice.variance * (choice.smoothness->score.array() /
                            (noise + choice.variance * choice.smoothness->shown.array()))
                               .matrix();
}

double noise_beside(const SmoothnessChoice& choice, double noise, double whole, double freedom) {
  const Smoothness& s = *choice.smoothness;
  const Eigen::VectorXd z = mean_of(choice, noise);
  const double left = whole - 2.0 * z.dot(s.score) + z.cwiseAbs2().dot(s.shown);
  const double spent =
      (choice.variance * s.shown.array() / (noise + choice.variance * s.shown.array())).sum();
  return std::max(left, 0.0) / std::max(1.0, freedom - spent);
}

}  // namespace kinescope::trace
