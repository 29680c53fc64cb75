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
// Neighbouring rates, and neighbours of those that are likely. Over the part that is looked at half
// a step moves its ends by a fraction of the time in which joints turn back.
constexpr double kRateStep = 0.01;
constexpr double kFineRateStep = 0.002;
constexpr int kRateSteps = 22;
constexpr std::size_t kMostRates = 3;
// How much more than with clocks of one rate the pairs have to be explained: channels that go with
// nothing gain a few per cent at some rate.
constexpr double kClearGain = 1.1;

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

// -2 ln likelihood of the best tree of pairs at every offset from -steps to steps.
std::vector<double> costs_by_offset(const Series& thin, const std::vector<BodyPair>& pairs,
                                    const JointLog& log, double step_s, int steps,
                                    double max_gap_s) {
  std::vector<double> cost;
  for (int s = -steps; s <= steps; ++s) {
    const Readings readings = readings_at(log, thin, s * step_s, max_gap_s);
    cost.push_back(-pair_tree(pairs, thin.bodies.size(), readings).gain);
  }
  return cost;
}

int steps_to(double half_width_s, double step_s) {
  return std::max(1, static_cast<int>(std::floor(half_width_s / step_s)));
}

struct LikelyClock {
  ClockRate clock;
  double cost = 0.0;
};

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
  const int steps = steps_to(half_width_s, step_s);
  const std::vector<double> cost = costs_by_offset(thin, pairs, log, step_s, steps, max_gap_s);
  std::vector<double> likely;
  for (const int s : minima_of(cost)) likely.push_back((vertex(cost, s) - steps) * step_s);
  return likely;
}

std::vector<ClockRate> scan_clock_rates(const Series& series, const JointLog& log, double step_s,
                                        double half_width_s, double max_gap_s) {
  const Series thin = thinned(first_part(series, kRatePart), kMostInstants);
  const std::vector<BodyPair> pairs = body_pairs(thin, thin.size());
  const int steps = steps_to(half_width_s, step_s);
  const auto at = [&](double rate) {
    const JointLog same = with_clock(log, {rate, 0.0}, series.times_s.front());
    const std::vector<double> cost = costs_by_offset(thin, pairs, same, step_s, steps, max_gap_s);
    const auto best = std::ranges::min_element(cost);
    const double offset_s = (static_cast<double>(best - cost.begin()) - steps) * step_s;
    return LikelyClock{{rate, offset_s}, *best};
  };
  std::vector<LikelyClock> coarse;
  for (int k = -kRateSteps; k <= kRateSteps; ++k) {
    if (k != 0) coarse.push_back(at(std::pow(1.0 + kRateStep, k)));
  }
  std::ranges::stable_sort(coarse, {}, &LikelyClock::cost);
  std::vector<ClockRate> out;
  const double now = at(1.0).cost;
  for (const LikelyClock& start : coarse) {
    if (start.cost > kClearGain * now) break;
    const bool known = std::ranges::any_of(out, [&](const ClockRate& c) {
      return std::abs(c.rate - start.clock.rate) < 2.5 * kRateStep;
    });
    if (known) continue;
    LikelyClock best = start;
    for (double by = -kRateStep; by < kRateStep; by += kFineRateStep) {
      const LikelyClock other = at(start.clock.rate + by);
      if (other.cost < best.cost) best = other;
    }
    out.push_back(best.clock);
    if (out.size() == kMostRates) break;
  }
  return out;
}

JointLog with_clock(JointLog log, const ClockRate& clock, double first_frame_s) {
  for (double& t : log.times_s)
    t = first_frame_s + (t - first_frame_s - clock.offset_s) / clock.rate;
  return log;
}

Series first_part(const Series& series, double length_s) {
  Series out = series;
  const auto end = std::ranges::upper_bound(out.times_s, out.times_s.front() + length_s);
  const auto count = static_cast<std::size_t>(end - out.times_s.begin());
  out.times_s.resize(count);
  out.frames.resize(count);
  for (Body& body : out.bodies) body.at.resize(count);
  count_seen(out);
  return out;
}

}  // namespace kinescope::structure_search
