// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/cutoff.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kStepsPerOctave = 16.0;
constexpr double kMostlyNoise = 1.0;  // relative error of a signal that is lost

/// One signal's part of the criterion.
struct Term {
  Eigen::VectorXd frequency_hz, motion, noise;  ///< weighted by w^2k
  double power = 0.0;                           ///< sum of motion

  [[nodiscard]] double relative_square(double cutoff_hz, int order) const {
    if (power <= 0.0) return std::numeric_limits<double>::quiet_NaN();
    double sum = 0.0;
    for (Eigen::Index k = 0; k < motion.size(); ++k) {
      const double h = filter_response(frequency_hz(k), cutoff_hz, order);
      sum += (1.0 - h) * (1.0 - h) * motion(k) + h * h * noise(k);
    }
    return sum / power;
  }
};

Term make_term(const Spectrum& spectrum, const MotionAndNoise& parts, int derivatives) {
  Term term{spectrum.frequency_hz, parts.motion, parts.noise};
  for (Eigen::Index k = 0; k < term.motion.size(); ++k) {
    const double gain =
        std::pow(2.0 * std::numbers::pi * spectrum.frequency_hz(k), 2.0 * derivatives);
    term.motion(k) *= gain;
    term.noise(k) *= gain;
  }
  term.power = term.motion.sum();
  return term;
}

struct Criterion {
  std::vector<Term> motion, torque;
  Eigen::VectorXd end_hz, shares;
  double highest_hz = std::numeric_limits<double>::infinity();
  int order = 3;

  [[nodiscard]] Eigen::VectorXd errors(double cutoff_hz) const {
    Eigen::VectorXd out(static_cast<Eigen::Index>(motion.size()));
    for (std::size_t j = 0; j < motion.size(); ++j) {
      const auto at = static_cast<Eigen::Index>(j);
      out(at) = shares(at) > 0.0 ? std::sqrt(motion[j].relative_square(cutoff_hz, order))
                                 : std::numeric_limits<double>::quiet_NaN();
    }
    return out;
  }

  /// A signal lost in noise counts as lost once, however much noise it has.
  [[nodiscard]] double total(double cutoff_hz) const {
    double sum = 0.0;
    for (std::size_t j = 0; j < motion.size(); ++j) {
      const double share = shares(static_cast<Eigen::Index>(j));
      if (share <= 0.0) continue;
      sum += share * lost(motion[j], cutoff_hz);
      if (j < torque.size()) sum += lost(torque[j], cutoff_hz);
    }
    return sum;
  }

  [[nodiscard]] double lost(const Term& term, double cutoff_hz) const {
    const double square = term.relative_square(cutoff_hz, order);
    return std::isfinite(square) ? std::min(square, kMostlyNoise) : 0.0;
  }
};

Criterion make_criterion(const CutoffEvidence& evidence, int order) {
  Criterion out;
  out.order = order;
  out.shares = evidence.shares;
  out.end_hz.resize(static_cast<Eigen::Index>(evidence.motion.size()));
  for (const Spectrum& spectrum : evidence.motion) {
    const auto joint = static_cast<Eigen::Index>(out.motion.size());
    MotionAndNoise parts = separate(spectrum, evidence.derivatives - 1);
    if (parts.end_hz == 0.0 && joint < evidence.travel_speed.size()) {
      parts = steady_travel(spectrum, evidence.derivatives - 1, evidence.travel_speed(joint),
                            evidence.travel_s);
    }
    out.end_hz(joint) = parts.end_hz;
    out.motion.push_back(make_term(spectrum, parts, evidence.derivatives));
    if (spectrum.frequency_hz.size() == 0) continue;
    out.highest_hz =
        std::min(out.highest_hz, 2.0 * kHighestCutoff * spectrum.frequency_hz.maxCoeff());
  }
  for (const Spectrum& spectrum : evidence.torque) {
    out.torque.push_back(make_term(spectrum, separate(spectrum, 0), 0));
  }
  return out;
}

/// Median over the moving joints of where their motion ends: cutting below it loses more than
/// noise.
double typical_end(const Criterion& criterion) {
  std::vector<double> ends;
  for (Eigen::Index j = 0; j < criterion.end_hz.size(); ++j) {
    if (criterion.shares(j) > 0.0 && criterion.end_hz(j) > 0.0) ends.push_back(criterion.end_hz(j));
  }
  return median_of(std::move(ends));
}

}  // namespace

double filter_response(double frequency_hz, double cutoff_hz, int order) {
  return 1.0 /
         (1.0 + (std::numbers::sqrt2 - 1.0) * std::pow(frequency_hz / cutoff_hz, 2.0 * order));
}

CutoffChoice choose_cutoff(const CutoffEvidence& evidence, int order, double stated_hz) {
  const Criterion criterion = make_criterion(evidence, order);
  CutoffChoice choice;
  choice.motion_end_hz = criterion.end_hz;
  if (stated_hz > 0.0) {
    choice.cutoff_hz = stated_hz;
    choice.expected_error = criterion.errors(stated_hz);
    return choice;
  }
  const bool moves = (criterion.end_hz.array() > 0.0 && criterion.shares.array() > 0.0).any();
  if (!moves || !std::isfinite(criterion.highest_hz)) return choice;
  double best = std::numeric_limits<double>::infinity();
  const double lowest_hz =
      std::clamp(typical_end(criterion), kLowestCutoffHz, criterion.highest_hz);
  const int steps = static_cast<int>(kStepsPerOctave * std::log2(criterion.highest_hz / lowest_hz));
  for (int k = 0; k <= steps; ++k) {
    const double cutoff_hz = criterion.highest_hz * std::exp2(-k / kStepsPerOctave);
    const double sum = criterion.total(cutoff_hz);
    if (sum >= best) continue;
    best = sum;
    choice.cutoff_hz = cutoff_hz;
    choice.at_edge = k == 0;
  }
  choice.expected_error = criterion.errors(choice.cutoff_hz);
  choice.chosen = true;
  return choice;
}

}  // namespace kinescope
