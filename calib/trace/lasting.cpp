// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/lasting.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "calib/trace/distribution.h"
#include "calib/trace/rest.h"
#include "kinematics/core/median.h"

namespace kinescope::trace {
namespace {

// Noise is known from neighbours: what it is itself lasts two instants or so.
constexpr double kInstantsAlike = 2.0;
// Variance of the logarithm of a scale from medians, times samples (Rousseeuw and Croux 1993).
constexpr double kMedianVariance = 1.36;
constexpr double kManyFreedoms = 1e6;  // of t, which then is normal

// Of the rows of a place, in their noise; how many of them.
struct Scale {
  double times = 0.0;
  double rows = 0.0;
};

Scale scale_at(const Linearisation& linear, const RestPlace& place) {
  std::vector<double> ratios;
  for (Eigen::SparseMatrix<double>::InnerIterator entry(linear.carriers, place.carrier); entry;
       ++entry) {
    const Eigen::Index row = entry.row();
    if (linear.noise[row] > 0.0)
      ratios.push_back(std::abs(linear.residual[row]) / linear.noise[row]);
  }
  const auto rows = static_cast<double>(ratios.size());
  return {kSigmaOverMedian * median_of(std::move(ratios)), rows};
}

// Two scales are compared, that of the residual and that of the noise.
bool lasts(const Scale& scale, double level) {
  const double samples = std::max(1.0, scale.rows / kInstantsAlike);
  const double sigma = std::sqrt(2.0 * kMedianVariance / samples);
  return scale.times * std::exp(-t_quantile(level, kManyFreedoms) * sigma) > kLasts;
}

}  // namespace

double squares_at(const Linearisation& linear, const RestPlace& place) {
  double out = 0.0;
  for (Eigen::SparseMatrix<double>::InnerIterator entry(linear.carriers, place.carrier); entry;
       ++entry) {
    out += linear.residual[entry.row()] * linear.residual[entry.row()];
  }
  return out;
}

std::optional<double> over_neighbours(const NormalSystem& system, double squares) {
  if (!system.linear().whitened_by_neighbours) return std::nullopt;
  return std::sqrt(squares / system.freedom());
}

std::vector<LeftOver> left_over(const NormalSystem& system, const std::vector<RestPlace>& places,
                                const std::vector<Covariate>& covariates, double level) {
  std::vector<LeftOver> out;
  const Linearisation& linear = system.linear();
  if (linear.noise.size() == 0) return out;
  for (const RestPlace& place : places) {
    const Scale scale = scale_at(linear, place);
    if (scale.rows == 0.0) continue;
    LeftOver left{place.name, scale.times, lasts(scale, level / static_cast<double>(places.size())),
                  "", 0.0};
    const double squares = squares_at(linear, place);
    if (left.lasts && squares > 0.0) {
      const auto [over, gain] = most_telling(system, place, covariates);
      if (over != nullptr) left.covariate = over->name;
      left.explained = std::clamp(gain / squares, 0.0, 1.0);
    }
    out.push_back(std::move(left));
  }
  std::ranges::stable_sort(out, std::greater{}, &LeftOver::times);
  return out;
}

std::string lasting_words(const std::vector<LeftOver>& left) {
  std::string out;
  for (const LeftOver& one : left) {
    if (!one.lasts) continue;
    out += fmt::format("{}{:.2g} times its noise at {}", out.empty() ? "" : ", ", one.times,
                       one.place);
    if (!one.covariate.empty())
      out += fmt::format(" ({:.0f} % of it over {})", 100.0 * one.explained, one.covariate);
  }
  return out;
}

}  // namespace kinescope::trace
