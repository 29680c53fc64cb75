// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/curve.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/dense_algebra.h"

namespace kinescope::trace {
namespace {

// The variance of the process is looked for from a thousandth to 1e9 times its natural scale.
constexpr int kVariances = 49;
constexpr double kVarianceStep = 0.25;  // decades
constexpr int kNoiseSteps = 4;

// How many rows say the same because noise lasts.
double memory_of(const Linearisation& linear) {
  const Eigen::Index n = linear.instants();
  if (linear.independent_instants || n < 2) return 1.0;
  const double step = (linear.time_s[n - 1] - linear.time_s[0]) / static_cast<double>(n - 1);
  return std::max(1.0, 2.0 * linear.correlation_time_s / step);
}

double freedom_of(const NormalSystem& system) {
  return std::max(1.0, static_cast<double>(system.linear().residual.size() - system.parameters()));
}

// A curve of one length, in coordinates in which prior and data are both diagonal.
struct Smoothness {
  double length = 0.0;
  Eigen::VectorXd shown;  // data: information of each
  Eigen::VectorXd score;
};

Smoothness diagonalise(const NormalSystem& system, const Candidate& candidate, double length) {
  const EffectSums sums = system.sums(candidate.columns(length));
  const Eigen::MatrixXd B = system.inverse() * sums.JE;
  const SymmetricEigen eigen = symmetric_eigen(sums.EE - sums.JE.transpose() * B);
  const Eigen::VectorXd score = sums.Er - B.transpose() * system.total().g;
  return {length, eigen.values.cwiseMax(0.0), eigen.vectors.transpose() * score};
}

struct Choice {
  const Smoothness* smoothness = nullptr;
  double variance = 0.0;
  double log_evidence = 0.0;  // that of no curve
};

Choice choose(const std::vector<Smoothness>& all, double noise) {
  Choice best;
  for (const Smoothness& s : all) {
    const double natural =
        noise * static_cast<double>(s.shown.size()) / std::max(1e-300, s.shown.sum());
    for (int v = 0; v < kVariances; ++v) {
      const double variance = natural * std::pow(10.0, -3.0 + kVarianceStep * v);
      const Eigen::ArrayXd gain = 1.0 + variance / noise * s.shown.array();
      const double log_evidence =
          0.5 * (variance / (noise * noise) * s.score.array().square() / gain).sum() -
          0.5 * gain.log().sum();
      if (log_evidence > best.log_evidence) best = {&s, variance, log_evidence};
    }
  }
  return best;
}

// Of a whitened row beside this curve, without its memory.
double white_beside(const NormalSystem& system, const Choice& choice, double noise) {
  const double whole = system.total().rr;
  if (choice.smoothness == nullptr) return whole / freedom_of(system);
  const Smoothness& s = *choice.smoothness;
  const Eigen::ArrayXd weight =
      choice.variance / (noise + choice.variance * s.shown.array());  // coefficients = weight score
  const Eigen::ArrayXd z = weight * s.score.array();
  const double left =
      whole - 2.0 * (z * s.score.array()).sum() + (z.square() * s.shown.array()).sum();
  const double spent = (weight * s.shown.array()).sum();
  return std::max(left, 0.0) / std::max(1.0, freedom_of(system) - spent);
}

// The model without some of its last parameters, at whose values `taken` the residual stands.
Linearisation without_columns(const Linearisation& linear, Eigen::Index first,
                              const Eigen::VectorXd& taken) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index c = 0; c < linear.jacobian.cols(); ++c) {
    if (c < first || c >= first + taken.size()) kept.push_back(c);
  }
  Linearisation out = linear;
  out.residual += linear.jacobian.middleCols(first, taken.size()) * taken;
  out.jacobian = linear.jacobian(Eigen::all, kept);
  if (linear.prior.size() > 0) out.prior = linear.prior(kept, kept);
  if (linear.prior_gradient.size() > 0) out.prior_gradient = linear.prior_gradient(kept);
  return out;
}

}  // namespace

std::optional<AddedEffect> likeliest_curve(const NormalSystem& system, const Candidate& candidate) {
  std::vector<Smoothness> all;
  for (const double length : candidate.scan) {
    all.push_back(diagonalise(system, candidate, length));
  }
  const double memory = memory_of(system.linear());
  double noise = memory * system.total().rr / freedom_of(system);
  Choice choice;
  for (int i = 0; i < kNoiseSteps; ++i) {
    choice = choose(all, noise);
    noise = memory * white_beside(system, choice, noise);
  }
  if (choice.smoothness == nullptr || !(noise > 0.0)) return std::nullopt;
  return AddedEffect{candidate.id, choice.smoothness->length, std::sqrt(choice.variance / noise)};
}

std::vector<AddedEffect> tuned_curves(const Stage& stage) {
  std::vector<AddedEffect> out = stage.added;
  Eigen::Index first = stage.system.parameters();
  for (const Eigen::VectorXd& values : stage.fit.values) first -= values.size();
  for (std::size_t i = 0; i < stage.added.size(); ++i) {
    const Eigen::VectorXd& values = stage.fit.values[i];
    const Candidate* candidate = find_candidate(stage.fit, stage.added[i].id);
    if (candidate != nullptr && candidate->is_curve()) {
      const Linearisation without = without_columns(stage.fit.linear, first, values);
      const NormalSystem system(without, stage.system.partition());
      if (const auto tuned = likeliest_curve(system, *candidate)) out[i] = *tuned;
    }
    first += values.size();
  }
  return out;
}

Eigen::MatrixXd posterior_covariance(const NormalSystem& system, Eigen::Index count) {
  const double noise = memory_of(system.linear()) * system.total().rr / freedom_of(system);
  return noise * system.inverse().bottomRightCorner(count, count);
}

}  // namespace kinescope::trace
