// SPDX-License-Identifier: Apache-2.0
#include "calib/tracks/even_stamps.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <span>

#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr std::size_t kFewestStamps = 30;  // frames; chosen
constexpr double kTurn = 2.0 * std::numbers::pi;

std::complex<double> phasor(std::span<const double> times_s, double rate_hz) {
  std::complex<double> out = 0.0;
  for (const double t : times_s) out += std::polar(1.0, kTurn * rate_hz * (t - times_s.front()));
  return out / static_cast<double>(times_s.size());
}

// A rate, and how high the periodogram of some first stamps is there.
struct Peak {
  double rate_hz = 0.0;
  double height = 0.0;
};

void take(std::span<const double> times_s, double rate_hz, Peak& best) {
  const double height = std::norm(phasor(times_s, rate_hz));
  if (height > best.height) best = {rate_hz, height};
}

// Frames that come late make the median step too short or too long by some of it. All near rates
// are tried on the first stamps, and the best of them follows as there are twice as many: the time
// is in proportion to their number.
double likeliest_rate(const std::vector<double>& times_s) {
  constexpr std::size_t kFirst = 1000;  // stamps; chosen
  constexpr double kNear = 0.1;         // of the rate, on either side; chosen
  constexpr double kStep = 0.1;         // of what a period more or less in all of them is
  constexpr double kFinest = 1e-4;      // of the same
  std::vector<double> steps;
  for (std::size_t i = 1; i < times_s.size(); ++i) steps.push_back(times_s[i] - times_s[i - 1]);
  const double about = 1.0 / median_of(std::move(steps));
  std::span<const double> some(times_s.data(), std::min(kFirst, times_s.size()));
  Peak best{about, std::norm(phasor(some, about))};
  const double coarse = kStep / (some.back() - some.front());
  for (double rate = (1.0 - kNear) * about; rate <= (1.0 + kNear) * about; rate += coarse)
    take(some, rate, best);
  while (true) {
    const double span_s = some.back() - some.front();
    for (double step = 2.0 * kStep / span_s; step > kFinest / span_s; step *= 0.5) {
      const double around = best.rate_hz;
      take(some, around - step, best);
      take(some, around + step, best);
    }
    if (some.size() == times_s.size()) return best.rate_hz;
    some = {times_s.data(), std::min(2 * some.size(), times_s.size())};
    best.height = std::norm(phasor(some, best.rate_hz));
  }
}

// Of each frame; no two are of one. From the last one back: what arrives late is behind its period.
std::vector<double> periods_of(const std::vector<double>& times_s, double rate_hz) {
  const double shift = std::arg(phasor(times_s, rate_hz)) / kTurn;
  std::vector<double> out(times_s.size());
  for (std::size_t i = out.size(); i-- > 0;) {
    out[i] = std::round((times_s[i] - times_s.front()) * rate_hz - shift);
    if (i + 1 < out.size()) out[i] = std::min(out[i], out[i + 1] - 1.0);
  }
  return out;
}

}  // namespace

std::optional<EvenStamps> even_stamps(const std::vector<double>& times_s) {
  constexpr double kEven = 1e-3;  // of a period, about what stamps are rounded to; chosen
  constexpr double kFull = 0.5;   // of the periods
  if (times_s.size() < kFewestStamps) return std::nullopt;
  const double rate_hz = likeliest_rate(times_s);
  const std::vector<double> periods = periods_of(times_s, rate_hz);
  const auto count = static_cast<double>(times_s.size());
  if (count < kFull * (periods.back() - periods.front() + 1.0)) return std::nullopt;
  // What comes late by itself must not turn the line.
  const double period_s = 1.0 / rate_hz;
  std::vector<double> begun;
  for (std::size_t i = 0; i < times_s.size(); ++i)
    begun.push_back(times_s[i] - period_s * periods[i]);
  const double begin_s = median_of(std::move(begun));
  EvenStamps out{{}, rate_hz, 0.0};
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    out.times_s.push_back(begin_s + period_s * periods[i]);
    out.scatter_s += std::pow(times_s[i] - out.times_s.back(), 2) / count;
  }
  out.scatter_s = std::sqrt(out.scatter_s);
  if (out.scatter_s < kEven * period_s) return std::nullopt;
  return out;
}

}  // namespace kinescope
