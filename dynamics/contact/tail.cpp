// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/tail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr int kWantedPeaks = 100;
constexpr std::array kLevels{0.995, 0.99, 0.98, 0.96, 0.93, 0.9, 0.85, 0.8, 0.7, 0.6, 0.5};

std::vector<double> peaks_above(const StatisticRecord& record, double level) {
  const auto gap = static_cast<std::size_t>(std::ceil(record.cluster_gap_s / record.step_s));
  std::vector<double> peaks;
  std::size_t last = 0;
  for (std::size_t k = 0; k < record.values.size(); ++k) {
    const double value = record.values[k];
    if (!(value > level)) continue;
    if (peaks.empty() || k - last > gap) {
      peaks.push_back(value);
    } else {
      peaks.back() = std::max(peaks.back(), value);
    }
    last = k;
  }
  return peaks;
}

/// Shape of the excesses by L-moments.
void fit_pareto(std::vector<double> peaks, TailFit& fit) {
  std::ranges::sort(peaks);
  const auto m = static_cast<double>(peaks.size());
  double mean = 0.0;
  double upper = 0.0;  // mean of excess times (1 - F)
  for (std::size_t i = 0; i < peaks.size(); ++i) {
    const double excess = peaks[i] - fit.level;
    mean += excess / m;
    upper += excess * (m - 1.0 - static_cast<double>(i)) / (m - 1.0) / m;
  }
  const double shape = 2.0 - mean / (mean - 2.0 * upper);
  fit.mean_excess = mean;
  fit.own_shape = std::isfinite(shape) ? shape : 0.0;
  fit.set_shape(fit.own_shape);
}

}  // namespace

void TailFit::set_shape(double value) {
  const double heavy = std::clamp(value, 0.0, 0.9);
  scale = mean_excess * (1.0 - heavy);
  shape = heavy + 1.0 / peaks;
}

double TailFit::quantile(double wanted_per_s) const {
  const double ratio = std::max(1.0, rate_per_s / wanted_per_s);
  return level + scale * (std::pow(ratio, shape) - 1.0) / shape;
}

double TailFit::rate_above(double value) const {
  const double excess = std::max(0.0, value - level);
  return rate_per_s * std::pow(1.0 + shape * excess / scale, -1.0 / shape);
}

TailFit fit_tail(const StatisticRecord& record) {
  std::vector<double> sorted;
  sorted.reserve(record.values.size());
  for (const double value : record.values) {
    if (std::isfinite(value)) sorted.push_back(value);
  }
  std::ranges::sort(sorted);
  TailFit fit{.exposure_s = static_cast<double>(sorted.size()) * record.step_s};
  std::vector<double> best;
  for (const double share : kLevels) {
    if (sorted.empty()) break;
    const double level =
        sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
    std::vector<double> peaks = peaks_above(record, level);
    if (peaks.size() <= best.size()) continue;
    best = std::move(peaks);
    fit.level = level;
    if (best.size() >= kWantedPeaks) break;
  }
  if (best.empty() || static_cast<int>(best.size()) < record.fewest_peaks) {
    throw undetermined("contact",
                       "only " + std::to_string(best.size()) +
                           " separate peaks without contact to learn the false-alarm rate from",
                       "record more free motion, some ten seconds at least");
  }
  fit.peaks = static_cast<int>(best.size());
  fit.rate_per_s = static_cast<double>(best.size()) / fit.exposure_s;
  fit_pareto(std::move(best), fit);
  return fit;
}

}  // namespace kinescope
