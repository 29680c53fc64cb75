// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/curve.h"

#include <algorithm>
#include <cmath>

#include "calib/trace/smoothness.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope::trace {
namespace {

constexpr double kVarianceStep = 0.25;  // decades
constexpr int kNoiseSteps = 4;

Smoothness diagonalise(const NormalSystem& system, const Candidate& candidate, double length) {
  const EffectSums sums = system.sums(candidate.columns(length));
  const Eigen::MatrixXd B = system.inverse() * sums.JE;
  const SymmetricEigen eigen = symmetric_eigen(sums.EE - sums.JE.transpose() * B);
  const Eigen::VectorXd score = sums.Er - B.transpose() * system.total().g;
  return {length, eigen.values.cwiseMax(0.0), eigen.vectors.transpose() * score, {}};
}

}  // namespace

std::optional<AddedEffect> likeliest_curve(const NormalSystem& system, const Candidate& candidate) {
  std::vector<Smoothness> all;
  for (const double length : candidate.scan) {
    all.push_back(diagonalise(system, candidate, length));
  }
  const double whole = system.total().rr;
  const double freedom = system.freedom();
  double noise = system.memory() * whole / freedom;
  SmoothnessChoice choice;
  for (int i = 0; i < kNoiseSteps; ++i) {
    choice = likeliest_smoothness(all, noise, kVarianceStep);
    if (!(choice.log_evidence > 0.0)) return std::nullopt;
    noise = system.memory() * noise_beside(choice, noise, whole, freedom);
  }
  if (!(noise > 0.0)) return std::nullopt;
  return AddedEffect{candidate.id, choice.smoothness->length, std::sqrt(choice.variance / noise)};
}

std::vector<AddedEffect> tuned_curves(const Stage& stage) {
  std::vector<AddedEffect> out = stage.added;
  for (std::size_t i = 0; i < stage.added.size(); ++i) {
    const Candidate* candidate = find_candidate(stage.fit, stage.added[i].id);
    if (candidate == nullptr || !candidate->is_curve()) continue;
    const Linearisation without = without_effect(stage, i);
    const NormalSystem system(without, stage.system.partition());
    if (const auto tuned = likeliest_curve(system, *candidate)) out[i] = *tuned;
  }
  return out;
}

void size_up_curve(const std::vector<EffectColumn>& columns, double t, TracedEffect& effect) {
  EffectPicture& picture = effect.picture;
  Eigen::MatrixXd shares(picture.effect.size(), std::ssize(columns));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    shares.col(static_cast<Eigen::Index>(k)) = columns[k].share;
  }
  picture.sigma =
      (shares * effect.covariance).cwiseProduct(shares).rowwise().sum().cwiseMax(0.0).cwiseSqrt();
  Eigen::Index largest = 0;
  effect.size = picture.effect.cwiseAbs().maxCoeff(&largest);
  const double half = t * picture.sigma[largest];
  effect.interval = {std::max(0.0, effect.size - half), effect.size + half};
}

Eigen::MatrixXd posterior_covariance(const NormalSystem& system, Eigen::Index count) {
  const double noise = system.memory() * system.total().rr / system.freedom();
  return noise * system.inverse().bottomRightCorner(count, count);
}

}  // namespace kinescope::trace
