// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/spectrum.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <unsupported/Eigen/FFT>

#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr Eigen::Index kShortest = 32;
constexpr Eigen::Index kWantedWindows = 8;
constexpr Eigen::Index kLongest = 16384;
constexpr double kSixthOctave = 1.122;  // frequency ratio
constexpr double kClearOfNoise = 2.5;   // power over the level above that counts as motion
constexpr double kClearPeak = 5.0;      // the same, somewhere: else there is no motion
constexpr double kLargestValley = 1.5;  // frequency ratio

Eigen::Index windows_of(const std::vector<Eigen::VectorXd>& pieces, Eigen::Index length) {
  Eigen::Index count = 0;
  for (const Eigen::VectorXd& piece : pieces) {
    if (piece.size() >= length) count += 1 + (piece.size() - length) / (length / 2);
  }
  return count;
}

/// The longest power of two that still gives enough windows to average.
Eigen::Index window_length(const std::vector<Eigen::VectorXd>& pieces) {
  Eigen::Index length = kLongest;
  while (length > kShortest && windows_of(pieces, length) < kWantedWindows) length /= 2;
  return length;
}

Eigen::VectorXd differenced(Eigen::VectorXd x, int times) {
  for (int k = 0; k < times; ++k) {
    const Eigen::VectorXd next = x.tail(x.size() - 1) - x.head(x.size() - 1);
    x = next;
  }
  return x;
}

Eigen::VectorXd hann(Eigen::Index length) {
  return Eigen::VectorXd::NullaryExpr(length, [&](Eigen::Index k) {
    const double s =
        std::sin(std::numbers::pi * static_cast<double>(k) / static_cast<double>(length));
    return s * s;
  });
}

/// Power of the velocity, averaged over a third of an octave.
Eigen::VectorXd smooth_velocity_power(const Spectrum& spectrum, int to_velocity) {
  const Eigen::Index n = spectrum.power.size();
  Eigen::VectorXd sums = Eigen::VectorXd::Zero(n + 1);
  for (Eigen::Index k = 0; k < n; ++k) {
    const double omega = 2.0 * std::numbers::pi * spectrum.frequency_hz(k);
    sums(k + 1) = sums(k) + spectrum.power(k) * std::pow(omega, 2.0 * to_velocity);
  }
  Eigen::VectorXd out(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    // Bin k is frequency k + 1 in units of the first.
    const double at = static_cast<double>(k + 1);
    const auto low = std::max<Eigen::Index>(0, std::lround(at / kSixthOctave) - 1);
    const auto high = std::min<Eigen::Index>(n - 1, std::lround(at * kSixthOctave) - 1);
    out(k) = (sums(high + 1) - sums(low)) / static_cast<double>(high + 1 - low);
  }
  return out;
}

/// Median of the two octaves over bin k, never of less than the topmost eighth.
double level_above(const Eigen::VectorXd& power, Eigen::Index k) {
  const Eigen::Index n = power.size();
  const Eigen::Index first = std::min(k, n - std::max<Eigen::Index>(1, n / 8));
  const Eigen::Index last = std::min(n, 4 * (k + 1));
  return median_of(to_vector(power.segment(first, std::max<Eigen::Index>(1, last - first))));
}

/// Bins up to the end of the motion: from the strongest one upward; a gap of half an octave ends
/// it.
Eigen::Index motion_end(const Eigen::VectorXd& velocity_power) {
  Eigen::Index strongest = 0;
  velocity_power.maxCoeff(&strongest);
  Eigen::Index end = strongest + 1;
  double clearest = 0.0;
  for (Eigen::Index k = strongest; k < velocity_power.size(); ++k) {
    if (static_cast<double>(k) >
        kLargestValley * static_cast<double>(std::max<Eigen::Index>(end, 2))) {
      break;
    }
    const double clear = velocity_power(k) / level_above(velocity_power, k);
    if (clear > kClearOfNoise) end = k + 1;
    clearest = std::max(clearest, clear);
  }
  return clearest > kClearPeak ? end : 0;
}

}  // namespace

Spectrum power_spectrum(const EvenSeries& series, int differences) {
  std::vector<Eigen::VectorXd> pieces;
  for (const Eigen::VectorXd& piece : series.pieces) {
    if (piece.size() >= kShortest + differences) pieces.push_back(differenced(piece, differences));
  }
  Spectrum out;
  if (pieces.empty()) return out;
  const Eigen::Index length = window_length(pieces);
  const Eigen::VectorXd window = hann(length);
  Eigen::VectorXd power = Eigen::VectorXd::Zero(length / 2 + 1);
  Eigen::FFT<double> fft;
  for (const Eigen::VectorXd& piece : pieces) {
    for (Eigen::Index at = 0; at + length <= piece.size(); at += length / 2) {
      Eigen::VectorXd x = piece.segment(at, length);
      x.array() -= x.mean();
      x.array() *= window.array();
      Eigen::VectorXcd transform;
      fft.fwd(transform, x);
      power += transform.head(length / 2 + 1).cwiseAbs2();
      ++out.averaged;
    }
  }
  power *= 2.0 * series.step_s / (window.squaredNorm() * static_cast<double>(out.averaged));
  const Eigen::Index bins = length / 2;  // without frequency 0
  out.frequency_hz.resize(bins);
  out.power.resize(bins);
  for (Eigen::Index k = 0; k < bins; ++k) {
    out.frequency_hz(k) =
        static_cast<double>(k + 1) / (static_cast<double>(length) * series.step_s);
    const double difference =
        2.0 * std::sin(std::numbers::pi * out.frequency_hz(k) * series.step_s);
    out.power(k) = power(k + 1) / std::pow(difference * difference, differences);
  }
  return out;
}

MotionAndNoise separate(const Spectrum& spectrum, int to_velocity) {
  const Eigen::Index n = spectrum.power.size();
  MotionAndNoise out{Eigen::VectorXd::Zero(n), spectrum.power, 0.0};
  if (n == 0) return out;
  const Eigen::VectorXd velocity_power = smooth_velocity_power(spectrum, to_velocity);
  const Eigen::Index end = motion_end(velocity_power);
  if (end == 0) return out;
  out.end_hz = spectrum.frequency_hz(end - 1);
  // The level above the end, as the velocity's, undone at the end's frequency.
  const double omega = 2.0 * std::numbers::pi * out.end_hz;
  const double level =
      level_above(velocity_power, std::min(end, n - 1)) / std::pow(omega, 2.0 * to_velocity);
  for (Eigen::Index k = 0; k < end; ++k) {
    out.noise(k) = std::min(level, spectrum.power(k));
    out.motion(k) = spectrum.power(k) - out.noise(k);
  }
  return out;
}

MotionAndNoise steady_travel(const Spectrum& spectrum, int to_velocity, double speed,
                             double duration_s) {
  const Eigen::Index n = spectrum.power.size();
  MotionAndNoise out{Eigen::VectorXd::Zero(n), spectrum.power, 0.0};
  if (n == 0 || !(duration_s > 0.0)) return out;
  const Eigen::VectorXd noise = smooth_velocity_power(spectrum, to_velocity);
  for (Eigen::Index k = 0; k < n; ++k) {
    const double omega = 2.0 * std::numbers::pi * spectrum.frequency_hz(k);
    const double steps = 4.0 * speed * speed / (omega * omega * duration_s);
    if (!(steps > kClearOfNoise * noise(k))) break;
    out.end_hz = spectrum.frequency_hz(k);
    out.motion(k) = steps / std::pow(omega, 2.0 * to_velocity);
  }
  return out;
}

}  // namespace kinescope
