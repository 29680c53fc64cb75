// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/rest.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "calib/trace/lasting.h"
#include "calib/trace/score_test.h"
#include "calib/trace/vibration.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/parallel_for.h"

namespace kinescope::trace {
namespace {

constexpr std::size_t kTestKnots = 8;       // of the test: few, for power
constexpr std::size_t kStretchesAKnot = 5;  // fewer knots where few stretches judge them
// What lasts is there, and makes its stretches long and few: more of its shape is looked for (the
// part of a tanh that a coupling leaves, 5 noises large, needs more than four knots: `undeclared`,
// 13589).
constexpr std::size_t kStretchesAKnotOfWhatLasts = 3;
constexpr Eigen::Index kCurveKnots =
    24;  // of the Gaussian process: many, its prior keeps it smooth
// The variance of the process is looked for from a thousandth to 1e9 times its natural scale.
constexpr std::array<double, 5> kCurveLengths{1.0, 0.5, 0.25, 0.125,
                                              0.0625};  // of the covariate's range
constexpr int kVariances = 25;
// Of the residual's sum of squares: less changes the error by less than half a per cent.
constexpr double kLeastShare = 0.01;

// Values of the covariate that split the instants evenly; for a covariate of few values, those.
std::vector<double> even_knots(const Eigen::VectorXd& values, std::size_t most) {
  std::vector<double> sorted(values.begin(), values.end());
  std::ranges::sort(sorted);
  std::vector<double> distinct = sorted;
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  if (distinct.size() <= most) return distinct;
  std::vector<double> knots;
  for (std::size_t k = 0; k < most; ++k) {
    knots.push_back(sorted[k * (sorted.size() - 1) / (most - 1)]);
  }
  knots.erase(std::unique(knots.begin(), knots.end()), knots.end());
  return knots;
}

std::vector<double> equal_knots(const Eigen::VectorXd& values) {
  std::vector<double> few = even_knots(values, kTestKnots);
  if (few.size() < kTestKnots) return few;
  std::vector<double> knots;
  const double low = values.minCoeff();
  const double step = (values.maxCoeff() - low) / static_cast<double>(kCurveKnots - 1);
  for (Eigen::Index k = 0; k < kCurveKnots; ++k) {
    knots.push_back(low + step * static_cast<double>(k));
  }
  return knots;
}

// Piecewise linear functions, 1 on their own knot and 0 on the others.
std::vector<EffectColumn> hats(int carrier, const Eigen::VectorXd& values,
                               const std::vector<double>& knots) {
  std::vector<EffectColumn> out(knots.size(), {carrier, Eigen::VectorXd::Zero(values.size())});
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const auto above = std::ranges::upper_bound(knots, values[i]);
    if (above == knots.begin()) {
      out.front().share[i] = 1.0;
    } else if (above == knots.end()) {
      out.back().share[i] = 1.0;
    } else {
      const auto right = static_cast<std::size_t>(above - knots.begin());
      const double fraction = (values[i] - knots[right - 1]) / (knots[right] - knots[right - 1]);
      out[right - 1].share[i] = 1.0 - fraction;
      out[right].share[i] = fraction;
    }
  }
  return out;
}

// Squared exponential, variance 1, on the knots.
Eigen::MatrixXd correlation(const std::vector<double>& knots, double length) {
  const auto n = static_cast<Eigen::Index>(knots.size());
  Eigen::MatrixXd K(n, n);
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = 0; b < n; ++b) {
      const double d =
          (knots[static_cast<std::size_t>(a)] - knots[static_cast<std::size_t>(b)]) / length;
      K(a, b) = std::exp(-0.5 * d * d);
    }
  }
  K.diagonal().array() += 1e-8;
  return K;
}

// What the rows say about the knots' values, the model's own parameters taken out.
struct CurveEvidence {
  Eigen::MatrixXd S;
  Eigen::VectorXd score;
  double noise = 1.0;  // variance of a whitened row, widened for correlation in time
};

// Posterior over the knots' values.
struct Posterior {
  double log_evidence = -std::numeric_limits<double>::infinity();
  Eigen::MatrixXd prior_information;
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

// Rasmussen and Williams 2006, eq. 2.30, in the space of the knots' values.
Posterior posterior(const CurveEvidence& evidence, const Eigen::MatrixXd& K) {
  const Eigen::Index n = K.rows();
  const CholeskyFactor factor(K);
  Posterior out;
  if (!factor.positive_definite()) return out;
  const Eigen::MatrixXd L = factor.lower();
  // In the space z with theta = L z the prior is white.
  const Eigen::MatrixXd A =
      Eigen::MatrixXd::Identity(n, n) + L.transpose() * evidence.S * L / evidence.noise;
  const CholeskyFactor inner(A);
  if (!inner.positive_definite()) return out;
  const Eigen::VectorXd b = L.transpose() * evidence.score / evidence.noise;
  const Eigen::VectorXd z = inner.solve(b);
  const double log_determinant = 2.0 * inner.lower().diagonal().array().log().sum();
  out.log_evidence = 0.5 * b.dot(z) - 0.5 * log_determinant;
  out.mean = L * z;
  out.covariance = L * inner.solve(Eigen::MatrixXd(L.transpose()));
  out.prior_information = factor.inverse() * evidence.noise;
  return out;
}

Posterior best_posterior(const CurveEvidence& evidence, const std::vector<double>& knots) {
  const double range = knots.back() - knots.front();
  const double natural =
      evidence.noise * static_cast<double>(knots.size()) / std::max(1e-300, evidence.S.trace());
  Posterior best;
  for (const double length : kCurveLengths) {
    const Eigen::MatrixXd K = correlation(knots, length * std::max(range, 1e-300));
    for (int v = 0; v < kVariances; ++v) {
      const double variance = natural * std::pow(10.0, -3.0 + 0.5 * v);
      Posterior candidate = posterior(evidence, variance * K);
      if (candidate.log_evidence > best.log_evidence) best = std::move(candidate);
    }
  }
  return best;
}

CurveEvidence gather(const NormalSystem& system, const std::vector<EffectColumn>& columns,
                     const Score& score) {
  const EffectSums sums = system.sums(columns);
  const Eigen::MatrixXd B = system.inverse() * sums.JE;
  CurveEvidence out;
  out.S = sums.EE - sums.JE.transpose() * B;
  out.score = sums.Er - B.transpose() * system.total().g;
  const double white = (system.total().rr - score.gain) / system.freedom();
  // F of white noise would be gain / rank / white; the stretches say how much less it is.
  const double classical = score.gain / std::max(1, score.rank) / std::max(1e-300, white);
  const double widening = score.statistic > 0.0 ? classical / score.statistic : 1.0;
  out.noise = white * std::clamp(widening, 1.0, 100.0);
  return out;
}

Rest describe(const NormalSystem& system, const RestPlace& place, const Covariate& covariate,
              const std::vector<double>& knots, const Posterior& curve) {
  Rest rest;
  rest.place = place.name;
  rest.unit = place.unit;
  rest.covariate = covariate.name;
  rest.covariate_unit = covariate.unit;
  rest.at =
      Eigen::Map<const Eigen::VectorXd>(knots.data(), static_cast<Eigen::Index>(knots.size()));
  rest.mean = curve.mean;
  rest.sigma = curve.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  rest.instants = Eigen::VectorXd::Zero(system.linear().instants());
  const std::vector<EffectColumn> columns = hats(place.carrier, covariate.value, knots);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    rest.instants += curve.mean[static_cast<Eigen::Index>(k)] * columns[k].share;
  }
  return rest;
}

// By the floors of `options`, where the sum of squares falls by `gain`.
bool moves_enough(const NormalSystem& system, double gain, const std::vector<EffectColumn>& columns,
                  const TraceOptions& options) {
  return system.shift_of(gain, columns) >= options.floor &&
         system.noise_share_of(gain, columns) >= options.noise_floor;
}

// A place and what it follows.
struct Driven {
  RestPlace place;
  Covariate over;
  Score score;
  double p_value = 1.0;  // over all that were tried
};

struct Pair {
  const RestPlace* place = nullptr;
  const Covariate* covariate = nullptr;
  double gain = 0.0;
};

using ColumnsOf = std::function<std::vector<EffectColumn>(const RestPlace&, const Covariate&)>;

// All that move the prediction by the floors, those that explain most first: what is asked of each
// beyond that costs more.
std::vector<Pair> by_gain(const NormalSystem& system, const std::vector<RestPlace>& places,
                          const std::vector<Covariate>& covariates,
                          const std::vector<FoundRest>& known, const ColumnsOf& columns_of,
                          const TraceOptions& options) {
  std::vector<std::vector<Pair>> of_place(places.size());
  parallel_for(places.size(), [&](std::size_t k) {
    std::vector<Pair> pairs;
    std::vector<std::vector<EffectColumn>> columns;
    for (const Covariate& covariate : covariates) {
      const bool taken = std::ranges::any_of(known, [&](const FoundRest& found) {
        return found.rest.place == places[k].name && found.rest.covariate == covariate.name;
      });
      if (taken) continue;
      pairs.push_back({&places[k], &covariate});
      columns.push_back(columns_of(places[k], covariate));
    }
    const std::vector<double> gains = gains_of(system, columns);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      pairs[i].gain = gains[i];
      if (moves_enough(system, gains[i], columns[i], options)) of_place[k].push_back(pairs[i]);
    }
  });
  std::vector<Pair> out;
  for (const std::vector<Pair>& pairs : of_place) out.insert(out.end(), pairs.begin(), pairs.end());
  std::ranges::stable_sort(out, std::greater{}, &Pair::gain);
  return out;
}

// The first of them that its own stretches show at this level, `tests` having been made; beyond the
// level where a stretch is left out, too.
std::optional<Driven> first_shown(const NormalSystem& system, const std::vector<Pair>& pairs,
                                  const ColumnsOf& columns_of, double tests, double level,
                                  const TraceOptions& options) {
  constexpr std::size_t kAtOnce = 8;
  for (std::size_t begin = 0; begin < pairs.size(); begin += kAtOnce) {
    std::vector<Score> scores(std::min(kAtOnce, pairs.size() - begin));
    parallel_for(scores.size(), [&](std::size_t k) {
      const Pair& pair = pairs[begin + k];
      scores[k] = score_test(system, columns_of(*pair.place, *pair.covariate));
    });
    for (std::size_t k = 0; k < scores.size(); ++k) {
      if (scores[k].hidden() || scores[k].p_value * tests > level || !is_large(scores[k], options))
        continue;
      const Pair& pair = pairs[begin + k];
      const Score confirmed = jackknife_test(system, columns_of(*pair.place, *pair.covariate));
      if (confirmed.p_value * tests <= level)
        return Driven{*pair.place, *pair.covariate, confirmed, confirmed.p_value * tests};
    }
  }
  return std::nullopt;
}

std::size_t test_knots_of(const NormalSystem& system,
                          std::size_t stretches_a_knot = kStretchesAKnot) {
  return std::clamp<std::size_t>(
      static_cast<std::size_t>(system.partition().stretches) / stretches_a_knot, 3, kTestKnots);
}

// By how much the sum of squares falls in the step to the system's own solution.
double still_to_gain(const NormalSystem& system) {
  const Eigen::VectorXd& step = system.step();
  return 2.0 * step.dot(system.total().g) - step.dot(system.total().H * step);
}

bool lasts(const NormalSystem& system) {
  return over_neighbours(system, system.total().rr - still_to_gain(system)).value_or(0.0) > kLasts;
}

}  // namespace

Linearisation extend(const Linearisation& linear, const FoundRest& found) {
  return found.rest.is_field() ? extend(linear, found.rows, found.prior)
                               : extend(linear, found.columns, found.prior);
}

bool earns_its_place(const NormalSystem& system, FoundRest& found, double& gain) {
  const Linearisation with = extend(system.linear(), found);
  const NormalSystem after(with, system.partition());
  // What was found before is in the system, but not taken out of its residual.
  gain = still_to_gain(after) - still_to_gain(system);
  found.rest.explained = gain / system.total().rr;
  if (found.rest.explained < kLeastShare) return false;
  found.rest.held_out_before = held_out_error(system, held_out_instants(system));
  const HeldOutInstants instants = held_out_instants(after);
  found.rest.held_out_after = held_out_error(after, instants);
  found.held_out = instants.whitened;
  // What does not help to predict is no structure.
  return found.rest.held_out_after.value < found.rest.held_out_before.value;
}

// The curve over what was shown, where it is one for sure.
std::optional<FoundRest> curve_of(const NormalSystem& system, const Driven& driven,
                                  const TraceOptions& options) {
  const std::vector<double> knots = equal_knots(driven.over.value);
  FoundRest out;
  out.columns = hats(driven.place.carrier, driven.over.value, knots);
  const Posterior curve = best_posterior(gather(system, out.columns, driven.score), knots);
  if (curve.mean.size() == 0) return std::nullopt;  // beside the others it says nothing of its own
  out.prior = curve.prior_information;
  out.rest = describe(system, driven.place, driven.over, knots, curve);
  out.rest.p_value = std::min(1.0, driven.p_value);
  double gain = 0.0;
  if (!earns_its_place(system, out, gain)) return std::nullopt;
  if (!moves_enough(system, gain, out.columns, options)) return std::nullopt;
  return out;
}

std::optional<FoundRest> find_rest(const NormalSystem& system, const std::vector<RestPlace>& places,
                                   const std::vector<Covariate>& covariates,
                                   const std::vector<FoundRest>& known, double level,
                                   const TraceOptions& options) {
  const auto pairs = static_cast<double>(places.size() * covariates.size());
  const auto shown_with = [&](std::size_t test_knots, double tests) {
    const auto columns_of = [&](const RestPlace& place, const Covariate& covariate) {
      return hats(place.carrier, covariate.value, even_knots(covariate.value, test_knots));
    };
    return first_shown(system, by_gain(system, places, covariates, known, columns_of, options),
                       columns_of, tests, level, options);
  };
  const std::size_t test_knots = test_knots_of(system);
  const std::size_t finer_knots = test_knots_of(system, kStretchesAKnotOfWhatLasts);
  std::optional<Driven> best = shown_with(test_knots, pairs);
  if (!best && finer_knots > test_knots && lasts(system))
    best = shown_with(finer_knots, 2.0 * pairs);
  if (best) {
    if (auto found = curve_of(system, *best, options)) return found;
  }
  auto vibration = find_vibration(system, places, covariates, level, options);
  if (!vibration) return std::nullopt;
  return curve_of(system,
                  {places[vibration->place], std::move(vibration->phase),
                   std::move(vibration->score), vibration->p_value},
                  options);
}

std::pair<const Covariate*, double> most_telling(const NormalSystem& system, const RestPlace& place,
                                                 const std::vector<Covariate>& covariates) {
  std::vector<std::vector<EffectColumn>> curves;
  for (const Covariate& covariate : covariates) {
    curves.push_back(
        hats(place.carrier, covariate.value, even_knots(covariate.value, test_knots_of(system))));
  }
  const std::vector<double> gains = gains_of(system, curves);
  const auto best = std::ranges::max_element(gains);
  if (best == gains.end() || !(*best > 0.0)) return {nullptr, 0.0};
  return {&covariates[static_cast<std::size_t>(best - gains.begin())], *best};
}

}  // namespace kinescope::trace
