// SPDX-License-Identifier: Apache-2.0
//
#include "kinematics/structure/time_offset.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/median.h"
#include "kinematics/structure/pair_tree.h"

namespace kinescope::structure_search {
namespace {

constexpr double kCoarsestStep = 0.1;  // s
constexpr double kFinestStep = 0.02;   // s
constexpr int kMostInstants = 160;
// Minima that get a structure of their own.
constexpr std::size_t kMostLikely = 4;
constexpr double kDeep = 0.5;  // of the deepest, below the median

// Local minima by cost, down to half as deep below the usual cost as the best; the middle one (no
// offset) is always among them.
std::vector<int> minima_of(const std::vector<double>& cost) {
  std::vector<int> out;
  const auto n = static_cast<int>(cost.size());
  const auto at = [&](int s) { return cost[static_cast<std::size_t>(s)]; };
  for (int s = 0; s < n; ++s) {
    if ((s == 0 || at(s) <= at(s - 1)) && (s == n - 1 || at(s) < at(s + 1))) out.push_back(s);
  }
  std::ranges::stable_sort(out, {}, at);
  const double usual = median_of(cost);
  std::erase_if(out, [&](int s) { return usual - at(s) < kDeep * (usual - at(out.front())); });
  if (out.size() > kMostLikely) out.resize(kMostLikely);
  const bool agreeing = std::ranges::any_of(out, [&](int s) { return std::abs(s - n / 2) <= 1; });
  if (!agreeing) out.push_back(n / 2);
  return out;
}

// The minimum of the parabola through a minimum and its neighbours, in steps.
double vertex(const std::vector<double>& cost, int s) {
  if (s == 0 || s + 1 == static_cast<int>(cost.size())) return s;
  const auto at = static_cast<std::size_t>(s);
  const double curvature = cost[at - 1] - 2.0 * cost[at] + cost[at + 1];
  if (!(curvature > 0.0)) return s;
  return s + std::clamp(0.5 * (cost[at - 1] - cost[at + 1]) / curvature, -0.5, 0.5);
}

}  // namespace

double offset_step(const Readings& readings) {
  double fastest = 0.0;
  for (Eigen::Index c = 0; c < readings.value.cols(); ++c) {
    if (!readings.moves(static_cast<int>(c))) continue;
    const double n = static_cast<double>(std::max<Eigen::Index>(1, readings.rate.rows()));
    fastest = std::max(fastest, std::sqrt(readings.rate.col(c).squaredNorm() / n));
  }
  return fastest > 0.0 ? std::clamp(0.25 / fastest, kFinestStep, kCoarsestStep) : kCoarsestStep;
}

std::vector<double> scan_time_offsets(const Series& series, const JointLog& log, double step_s,
                                      double half_width_s, double max_gap_s) {
  const Series thin = thinned(series, kMostInstants);
  const std::vector<BodyPair> pairs = body_pairs(thin, thin.size());
  const int steps = std::max(1, static_cast<int>(std::floor(half_width_s / step_s)));
  std::vector<double> cost;
  for (int s = -steps; s <= steps; ++s) {
    const Readings readings = readings_at(log, thin, s * step_s, max_gap_s);
    cost.push_back(-pair_tree(pairs, thin.bodies.size(), readings).gain);
  }
  std::vector<double> likely;
  for (const int s : minima_of(cost)) likely.push_back((vertex(cost, s) - steps) * step_s);
  return likely;
}

}  // namespace kinescope::structure_search
