// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/unwrap.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "kinematics/core/median.h"
#include "kinematics/log/joint_log.h"

namespace kinescope {
namespace {

constexpr std::size_t kFewestForVelocity = 10;  // samples; fewer show no velocity before and after
constexpr double kManyTimes = 5.0;              // a jump is larger than the usual step by this
constexpr double kUsual = 0.9;                  // quantile of the steps, and of their roughness
constexpr double kOfRoughness = 5.0;     // how far a jump may be from the velocity's prediction ..
constexpr double kLeastOfPeriod = 0.01;  // .. or this share of the period ..
constexpr double kMostOfPeriod = 0.1;    // .. and never more than this one
constexpr double kMotion = 3.0;          // times the noise that the channel moves at least
constexpr double kTurnDegrees = 360.0;
constexpr int kSmallestPower = 8;  // encoders of 8 to 32 bits
constexpr int kLargestPower = 32;
constexpr double kWindow_s = 1.0;  // how long to either side a channel may take to show a motion ..
constexpr std::size_t kWindow = 10;  // .. and in how many samples at least
constexpr double kPrinted = 1e-3;    // of a period that few digits may add to it

using Steps = std::vector<double>;

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto place =
      static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::ranges::nth_element(values, values.begin() + place);
  return values[static_cast<std::size_t>(place)];
}

// What is looked at again for every period that is tried.
struct Channel {
  const std::vector<double>& times_s;
  const Eigen::VectorXd& values;
  double range = 0.0;
  bool whole = false;  // ticks

  [[nodiscard]] double at(std::size_t i) const { return values[static_cast<Eigen::Index>(i)]; }
  [[nodiscard]] double step(std::size_t i) const { return at(i + 1) - at(i); }
  [[nodiscard]] double seconds(std::size_t i) const { return times_s[i + 1] - times_s[i]; }
  [[nodiscard]] bool is_gap(std::size_t i) const { return seconds(i) > kMaxGap; }
  [[nodiscard]] std::size_t steps() const { return times_s.size() - 1; }
  [[nodiscard]] std::vector<std::size_t> jumps_above(double size) const {
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < steps(); ++i) {
      if (std::abs(step(i)) > size && !is_gap(i)) out.push_back(i);
    }
    return out;
  }
};

// A step as the velocities of the steps before and after it predict it; the one there is at an end
// or a gap.
std::optional<double> predicted_step(const Channel& channel, const Steps& steps, std::size_t i) {
  double velocity = 0.0;
  int sides = 0;
  for (const std::size_t k : {i - 1, i + 1}) {  // i - 1 of 0 is beyond all steps
    if (k >= steps.size() || channel.is_gap(k)) continue;
    velocity += steps[k] / channel.seconds(k);
    ++sides;
  }
  if (sides == 0) return std::nullopt;
  return velocity / sides * channel.seconds(i);
}

// The way from step i on into one direction of time, once it is more than noise; 0 at rest.
double way_from(const Channel& channel, const Steps& steps, std::size_t i, int direction,
                double noise) {
  double way = 0.0;
  double seconds = 0.0;
  std::size_t k = i + static_cast<std::size_t>(direction);  // below 0 it is beyond all steps
  for (std::size_t n = 0; k < steps.size() && (n < kWindow || seconds < kWindow_s); ++n) {
    way += steps[k];
    seconds += channel.seconds(k);
    if (std::abs(way) > noise) return way;
    k += static_cast<std::size_t>(direction);
  }
  return 0.0;
}

bool passes_through(const Channel& channel, const Steps& steps, std::size_t i, double noise) {
  return way_from(channel, steps, i, -1, noise) * way_from(channel, steps, i, 1, noise) > 0.0;
}

// A sensor at rest on the border of its range.
bool turns_back(const Channel& channel, std::size_t jump, std::size_t next) {
  return channel.step(jump) * channel.step(next) < 0.0 &&
         (next - jump <= kWindow || channel.times_s[next] - channel.times_s[jump] < kWindow_s);
}

std::optional<Unwrapped> unwrap_with(const Channel& channel, double period, bool known) {
  const double quantum = channel.whole ? 1.0 : 0.0;
  if (channel.range > (1.0 + (known ? kPrinted : kLeastOfPeriod)) * period) return std::nullopt;
  const std::vector<std::size_t> jumps = channel.jumps_above(0.5 * period);
  if (jumps.empty()) return std::nullopt;

  Steps steps(channel.steps());
  std::vector<double> sizes;
  std::vector<double> roughness;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double turns = std::round(channel.step(i) / period);
    steps[i] = channel.step(i) - turns * period;
  }
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (channel.is_gap(i)) continue;
    sizes.push_back(std::abs(steps[i]));
    if (const auto expected = predicted_step(channel, steps, i)) {
      roughness.push_back(std::abs(steps[i] - *expected));
    }
  }
  const double rough = quantile(roughness, kUsual);
  const double tolerance = std::max(kOfRoughness * rough, kLeastOfPeriod * period) + quantum;
  if (tolerance > kMostOfPeriod * period + quantum) return std::nullopt;
  if (kManyTimes * quantile(sizes, kUsual) > period) return std::nullopt;

  const double noise = kOfRoughness * rough + quantum;
  std::size_t alive = 0;  // jumps that no move from rest to rest makes
  for (std::size_t n = 0; n < jumps.size(); ++n) {
    const std::size_t i = jumps[n];
    const auto expected = predicted_step(channel, steps, i);
    if (!expected || std::abs(steps[i] - *expected) > tolerance) return std::nullopt;
    const bool flickers = known && ((n > 0 && turns_back(channel, jumps[n - 1], i)) ||
                                    (n + 1 < jumps.size() && turns_back(channel, i, jumps[n + 1])));
    if (flickers || passes_through(channel, steps, i, noise)) ++alive;
  }
  if (2 * alive < jumps.size()) return std::nullopt;

  Unwrapped out{.values = channel.values,
                .period = period,
                .jumps = static_cast<int>(jumps.size()),
                .first = jumps.front()};
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double turns = std::round(channel.step(i) / period);
    // Whole turns are taken off what was logged, so that its digits stay.
    if (turns != 0.0) {
      const auto rest = static_cast<Eigen::Index>(steps.size() - i);
      out.values.tail(rest).array() -= turns * period;
    }
  }
  // What knows two places only is a switch, however often it is used.
  if (out.values.maxCoeff() - out.values.minCoeff() <= kMotion * noise) return std::nullopt;
  return out;
}

// The range that several jumps made in motion agree on: the jump and the motion within its step.
std::optional<double> period_of_jumps(const Channel& channel) {
  constexpr std::size_t kLeastJumps = 2;
  Steps steps(channel.steps());
  for (std::size_t i = 0; i < steps.size(); ++i) steps[i] = channel.step(i);
  std::vector<double> periods;
  const std::vector<std::size_t> jumps = channel.jumps_above(0.5 * channel.range);
  for (const std::size_t i : jumps) {
    // A single reading that is wrong.
    if (std::ranges::binary_search(jumps, i + 1) ||
        (i > 0 && std::ranges::binary_search(jumps, i - 1)))
      continue;
    const auto motion = predicted_step(channel, steps, i);
    if (!motion || !(*motion * steps[i] < 0.0)) continue;
    periods.push_back(std::abs(steps[i]) + std::abs(*motion));
  }
  if (periods.size() < kLeastJumps) return std::nullopt;
  const double period = median_of(periods);
  return channel.whole ? std::round(period) : period;
}

}  // namespace

std::optional<Unwrapped> unwrap(const std::vector<double>& times_s, const Eigen::VectorXd& values) {
  if (times_s.size() < kFewestForVelocity) return std::nullopt;
  const Channel channel{.times_s = times_s,
                        .values = values,
                        .range = values.maxCoeff() - values.minCoeff(),
                        .whole = (values.array() == values.array().round()).all()};
  if (!(channel.range > 0.0)) return std::nullopt;
  std::vector<double> periods{2.0 * std::numbers::pi, kTurnDegrees};
  if (channel.whole) {
    periods.insert(periods.end(), {10.0 * kTurnDegrees, 100.0 * kTurnDegrees});
    for (int bits = kSmallestPower; bits <= kLargestPower; ++bits) {
      periods.push_back(std::exp2(bits));
    }
  }
  for (const double period : periods) {
    if (auto found = unwrap_with(channel, period, true)) return found;
  }
  const auto period = period_of_jumps(channel);
  return period ? unwrap_with(channel, *period, false) : std::nullopt;
}

}  // namespace kinescope
