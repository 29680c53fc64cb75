// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/balance_noise.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr std::size_t kFewestSamples = 200;
/// Of the absolute values of a standard normal variable, the mean square of the smaller ones.
struct Trim {
  double share;
  double variance;
};
constexpr Trim kMostValues{0.95, 0.7588};
constexpr Trim kHalfOfThem{0.5, 0.1426};
/// Sum of squared coefficients of a third difference.
constexpr double kThirdDifference = 20.0;
constexpr double kLongestWindow_s = 4.0;

double trimmed_variance(std::vector<double> squares, const Trim& trim) {
  if (squares.empty()) return 0.0;
  const auto kept = std::max<std::size_t>(
      1, static_cast<std::size_t>(trim.share * static_cast<double>(squares.size())));
  std::nth_element(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(kept - 1),
                   squares.end());
  const double sum =
      std::accumulate(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(kept), 0.0);
  return sum / static_cast<double>(kept) / trim.variance;
}

/// For each sample the first of the unbroken stretch it stands in; a sample left out stands alone,
/// and one in which the joint may stick (-1: whatever sticks).
std::vector<std::size_t> stretches(const std::vector<BalanceSample>& samples,
                                   const std::vector<char>& use, double step_s,
                                   Eigen::Index joint) {
  std::vector<std::size_t> first(samples.size());
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const bool joined =
        k > 0 && (use.empty() || (use[k] != 0 && use[k - 1] != 0)) && is_finite(samples[k]) &&
        is_finite(samples[k - 1]) &&
        (joint < 0 || (!samples[k].may_stick(joint) && !samples[k - 1].may_stick(joint))) &&
        samples[k].stamp_s > samples[k - 1].stamp_s &&
        samples[k].stamp_s - samples[k - 1].stamp_s < 10.0 * step_s;
    first[k] = joined ? first[k - 1] : k;
  }
  return first;
}

template <typename Signal>
double white_sigma(const std::vector<std::size_t>& first, const Trim& trim, const Signal& signal) {
  std::vector<double> squares;
  double smallest = 0.0;
  for (std::size_t k = 3; k < first.size(); ++k) {
    if (first[k] + 3 > k) continue;
    const double d = signal(k) - 3.0 * signal(k - 1) + 3.0 * signal(k - 2) - signal(k - 3);
    squares.push_back(d * d);
    const double step = std::abs(signal(k) - signal(k - 1));
    if (step > 0.0 && (smallest == 0.0 || step < smallest)) smallest = step;
  }
  // A signal that rarely leaves its quantum has that quantum's noise.
  return std::max(std::sqrt(trimmed_variance(std::move(squares), trim) / kThirdDifference),
                  smallest / std::sqrt(12.0));
}

/// Accumulated imbalance of a joint, p(t) - p(0) - integral of drive dt, one entry a sample.
Eigen::VectorXd imbalance(const std::vector<BalanceSample>& samples,
                          const std::vector<std::size_t>& first, Eigen::Index joint) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(samples.size()));
  for (std::size_t k = 1; k < samples.size(); ++k) {
    if (first[k] == k) continue;
    const BalanceSample& a = samples[k - 1];
    const BalanceSample& b = samples[k];
    const double half_step = 0.5 * (b.stamp_s - a.stamp_s);
    const auto row = static_cast<Eigen::Index>(k);
    out[row] = out[row - 1] + b.momentum[joint] - a.momentum[joint] -
               half_step * (a.drive[joint] + b.drive[joint]);
  }
  return out;
}

/// Variance of one joint's imbalance over a window: measured, and its known part.
struct WindowVariance {
  double length_s = 0.0;
  double measured = 0.0;
  double white = 0.0;
  double weight = 0.0;  ///< independent windows
};

/// Mean square of an integrated Ornstein-Uhlenbeck process of unit variance.
double integrated_error(double length_s, double time_s) {
  const double x = length_s / time_s;
  return x < 1e-3 ? length_s * length_s * (1.0 - x / 3.0)
                  : 2.0 * time_s * time_s * (x - 1.0 + std::exp(-x));
}

struct ModelError {
  double sigma = 0.0;
  double time_s = 0.0;
};

/// From `first` up to `end`, each the last one times `factor`.
std::vector<double> scales_between(double first, double end, double factor) {
  std::vector<double> out;
  while (first < end) {
    out.push_back(first);
    first *= factor;
  }
  return out;
}

/// Least squares of the variances' logarithms over a grid; both are scales, a few per cent do not
/// matter.
ModelError fit_model_error(const std::vector<WindowVariance>& windows, double step_s,
                           double torque_sigma) {
  ModelError best;
  double best_cost = std::numeric_limits<double>::infinity();
  const std::vector<double> sigmas = scales_between(1e-3 * torque_sigma, 1e3 * torque_sigma, 1.12);
  for (const double time : scales_between(2.0 * step_s, 2.0 * kLongestWindow_s, 1.5)) {
    for (const double sigma : sigmas) {
      double cost = 0.0;
      for (const WindowVariance& window : windows) {
        const double expected =
            window.white + sigma * sigma * integrated_error(window.length_s, time);
        const double miss = std::log(window.measured / expected);
        cost += window.weight * miss * miss;
      }
      if (cost < best_cost) {
        best_cost = cost;
        best = {.sigma = sigma, .time_s = time};
      }
    }
  }
  return best;
}

/// Median: a model that doubts itself much at a few samples must not seem better at all others.
double usual_sigma(const std::vector<BalanceSample>& samples, Eigen::Index joint) {
  std::vector<double> sigmas;
  for (const BalanceSample& sample : samples) {
    if (std::isfinite(sample.sigma[joint])) sigmas.push_back(sample.sigma[joint]);
  }
  const double middle = median_of(sigmas);
  if (middle <= 0.0) {
    throw bad_request("contact", "a predictive sigma that is not positive",
                      "give the model's standard deviation");
  }
  return middle;
}

std::vector<WindowVariance> window_variances(const std::vector<BalanceSample>& samples,
                                             const std::vector<std::size_t>& first,
                                             const Eigen::VectorXd& imbalances, Eigen::Index joint,
                                             const BalanceNoise& noise, double step_s,
                                             const Trim& trim) {
  std::vector<WindowVariance> out;
  const std::size_t n = samples.size();
  for (std::size_t length = 1; static_cast<double>(length) * step_s <= kLongestWindow_s;
       length *= 2) {
    std::vector<double> squares;
    double white = 0.0;
    const std::size_t stride = std::max<std::size_t>(1, length / 8);
    for (std::size_t k = length; k < n; k += stride) {
      if (first[k] + length > k) continue;
      const double d = imbalances[static_cast<Eigen::Index>(k)] -
                       imbalances[static_cast<Eigen::Index>(k - length)];
      squares.push_back(d * d);
      if (samples[k].mass.size() > 0) {
        white += 2.0 * samples[k].mass.row(joint).cwiseAbs2().dot(noise.velocity_sigma.cwiseAbs2());
      }
    }
    const auto count = static_cast<double>(squares.size());
    const double independent = count * static_cast<double>(stride) / static_cast<double>(length);
    if (independent < 8.0) break;
    const double torque = step_s * noise.torque_sigma[joint];
    out.push_back({.length_s = static_cast<double>(length) * step_s,
                   .measured = trimmed_variance(std::move(squares), trim),
                   .white = white / count + static_cast<double>(length) * torque * torque,
                   .weight = std::min(independent, 100.0)});
  }
  return out;
}

std::size_t usable_samples(const std::vector<std::size_t>& first) {
  std::size_t out = 0;
  for (std::size_t k = 0; k < first.size(); ++k) out += first[k] != k ? 1U : 0U;
  return out;
}

/// So much noise that the joint's torque counts for nothing, and numbers stay within their digits.
double unheard_sigma(const std::vector<BalanceSample>& samples, Eigen::Index joint) {
  constexpr double kFactor = 1e4;
  double largest = 1.0;
  for (const BalanceSample& sample : samples) {
    if (is_finite(sample)) largest = std::max(largest, std::abs(sample.drive[joint]));
  }
  return kFactor * largest;
}

/// Noise of one log, and which joints it tells anything of.
struct HeardNoise {
  BalanceNoise noise;
  std::vector<char> heard;
  std::size_t usable = 0;  ///< samples, of the joint that has most
};

void add_white_noise(const std::vector<BalanceSample>& samples,
                     const std::vector<std::size_t>& anyhow, const std::vector<std::size_t>& own,
                     Eigen::Index joint, const Trim& trim, HeardNoise& out) {
  const bool heard = out.heard[static_cast<std::size_t>(joint)] != 0;
  BalanceNoise& noise = out.noise;
  if (samples[0].velocity.size() > 0) {
    noise.velocity_sigma[joint] = white_sigma(
        heard ? own : anyhow, trim, [&](std::size_t k) { return samples[k].velocity[joint]; });
  }
  if (!heard) {
    noise.torque_sigma[joint] = unheard_sigma(samples, joint);
    return;
  }
  noise.torque_sigma[joint] =
      white_sigma(own, trim, [&](std::size_t k) { return samples[k].drive[joint]; });
  if (noise.torque_sigma[joint] > 0.0) return;
  throw undetermined("contact", "the torque of joint " + std::to_string(joint + 1) + " is constant",
                     "log the measured torque");
}

HeardNoise heard_noise(const std::vector<BalanceSample>& samples, const std::vector<char>& use) {
  // Half of an unsorted log may be contact.
  const Trim& trim = use.empty() ? kHalfOfThem : kMostValues;
  const double step_s = median_step_s(samples);
  const Eigen::Index n = samples[0].drive.size();
  HeardNoise out{.noise = {.velocity_sigma = Eigen::VectorXd::Zero(n),
                           .torque_sigma = Eigen::VectorXd::Zero(n),
                           .model_sigma = Eigen::VectorXd::Zero(n),
                           .model_time_s = Eigen::VectorXd::Constant(n, 1.0)},
                 .heard = {}};
  std::vector<std::vector<std::size_t>> first;
  for (Eigen::Index j = 0; j < n; ++j) {
    first.push_back(stretches(samples, use, step_s, j));
    const std::size_t usable = usable_samples(first.back());
    out.heard.push_back(usable >= kFewestSamples ? 1 : 0);
    out.usable = std::max(out.usable, usable);
  }
  if (out.usable < kFewestSamples) return out;
  const std::vector<std::size_t> anyhow = stretches(samples, use, step_s, -1);
  for (Eigen::Index j = 0; j < n; ++j) {
    add_white_noise(samples, anyhow, first[static_cast<std::size_t>(j)], j, trim, out);
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto& own = first[static_cast<std::size_t>(j)];
    if (out.heard[static_cast<std::size_t>(j)] == 0) continue;
    const ModelError error = fit_model_error(
        window_variances(samples, own, imbalance(samples, own, j), j, out.noise, step_s, trim),
        step_s, out.noise.torque_sigma[j]);
    out.noise.model_sigma[j] = error.sigma / usual_sigma(samples, j);
    out.noise.model_time_s[j] = error.time_s;
  }
  return out;
}

/// Joint by joint the larger noise; of a joint that the second log tells nothing of, the first's.
BalanceNoise larger_of(BalanceNoise noise, const HeardNoise& own) {
  for (Eigen::Index j = 0; j < noise.torque_sigma.size(); ++j) {
    if (own.heard[static_cast<std::size_t>(j)] == 0) continue;
    noise.velocity_sigma[j] = std::max(noise.velocity_sigma[j], own.noise.velocity_sigma[j]);
    noise.torque_sigma[j] = std::max(noise.torque_sigma[j], own.noise.torque_sigma[j]);
    if (own.noise.model_sigma[j] <= noise.model_sigma[j]) continue;
    noise.model_sigma[j] = own.noise.model_sigma[j];
    noise.model_time_s[j] = own.noise.model_time_s[j];
  }
  return noise;
}

}  // namespace

double median_step_s(const std::vector<BalanceSample>& samples) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < samples.size(); ++k) {
    const double step = samples[k].stamp_s - samples[k - 1].stamp_s;
    if (step > 0.0 && std::isfinite(step)) steps.push_back(step);
  }
  if (steps.empty()) {
    throw undetermined("contact", "a log without two samples in time", "record a longer log");
  }
  return median_of(std::move(steps));
}

BalanceNoise estimate_noise(const std::vector<BalanceSample>& samples,
                            const std::vector<char>& use) {
  KINESCOPE_CHECK(use.empty() || use.size() == samples.size(), "one mark a sample");
  HeardNoise out = heard_noise(samples, use);
  if (out.usable >= kFewestSamples) return out.noise;
  throw undetermined("contact", "too few samples without contact: " + std::to_string(out.usable),
                     "record at least some seconds of free motion");
}

BalanceNoise estimate_noise_of_both(const std::vector<BalanceSample>& samples,
                                    const std::vector<char>& use, std::size_t second) {
  const auto middle = static_cast<std::ptrdiff_t>(second);
  const bool sorted = !use.empty();
  const auto marks = [&](std::ptrdiff_t from, std::ptrdiff_t to) {
    return sorted ? std::vector<char>(use.begin() + from, use.begin() + to) : std::vector<char>{};
  };
  const BalanceNoise learned =
      estimate_noise({samples.begin(), samples.begin() + middle}, marks(0, middle));
  const HeardNoise own =
      heard_noise({samples.begin() + middle, samples.end()}, marks(middle, std::ssize(samples)));
  return own.usable >= kFewestSamples ? larger_of(learned, own) : learned;
}

}  // namespace kinescope
