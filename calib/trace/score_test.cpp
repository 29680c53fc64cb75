// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/score_test.h"

#include <algorithm>
#include <cmath>

#include "calib/trace/distribution.h"
#include "calib/trace/normal_equations.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope::trace {
namespace {

// A direction of which less than this share (of its square) is left when the model's own parameters
// have taken what they can is not shown by the data.
constexpr double kHidden = 1e-7;
// Effective stretches beyond the effect's own parameters below which their scatter alone is no
// judge.
constexpr double kFewStretches = 8.0;
// What a single stretch shows may be anything that happened then.
constexpr double kFewestStretches = 2.0;

// The effect's columns combined so that they are of unit length and all shown: E -> E T.
Eigen::MatrixXd shown_directions(const EffectSums& sums, const Eigen::MatrixXd& S) {
  const Eigen::VectorXd scale = unit_scale(sums.EE);
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * S * scale.asDiagonal());
  Eigen::Index first = 0;
  while (first < S.rows() && !(eigen.values[first] > kHidden)) ++first;
  return scale.asDiagonal() * eigen.vectors.rightCols(S.rows() - first);
}

// Of directions T those that the data tell from the model's own parameters, and not the prior of
// these alone: about that no stretch disagrees, and yet it is no better known. `S_prior`: of S what
// the prior gives.
Eigen::MatrixXd told_by_data(const Eigen::MatrixXd& T, const Eigen::MatrixXd& S,
                             const Eigen::MatrixXd& S_prior) {
  constexpr double kHalf = 0.5;
  const SymmetricEigen own = symmetric_eigen(T.transpose() * S * T);
  const Eigen::MatrixXd white =
      T * own.vectors * own.values.cwiseMax(1e-300).cwiseInverse().cwiseSqrt().asDiagonal();
  const SymmetricEigen share = symmetric_eigen(white.transpose() * S_prior * white);
  Eigen::Index told = 0;
  while (told < share.values.size() && share.values[told] < kHalf) ++told;
  return told == T.cols() ? T : Eigen::MatrixXd(white * share.vectors.leftCols(told));
}

EffectSums combine(const EffectSums& sums, const Eigen::MatrixXd& T) {
  return {sums.JE * T, T.transpose() * sums.EE * T, T.transpose() * sums.Er};
}

// The effect beside the model: what is left of it, and the joint least squares solution.
struct Projected {
  Eigen::MatrixXd T;
  Eigen::MatrixXd B;  // the model's parameters that imitate the effect
  Eigen::MatrixXd S;  // normal matrix of what they cannot imitate
  Eigen::MatrixXd S_inverse;
  Eigen::VectorXd alone;  // the diagonal of S, of E
  Eigen::VectorXd theta;  // of E T
  Eigen::VectorXd delta;  // step of the model's parameters
  double gain = 0.0;
};

// `imitation`: of the raw columns by the model's parameters.
Projected project(const NormalSystem& system, const EffectSums& raw,
                  const Eigen::MatrixXd& imitation) {
  Projected out;
  const Eigen::MatrixXd S_raw = raw.EE - raw.JE.transpose() * imitation;
  out.T = shown_directions(raw, S_raw);
  const Eigen::MatrixXd& prior = system.linear().prior;
  if (prior.size() > 0 && out.T.cols() > 0)
    out.T = told_by_data(out.T, S_raw, imitation.transpose() * prior * imitation);
  out.B = imitation * out.T;
  out.S = out.T.transpose() * S_raw * out.T;
  out.S_inverse = scaled_pseudo_inverse(out.S, 0.0);
  out.alone = S_raw.diagonal().cwiseMax(0.0);
  const Eigen::VectorXd score =
      out.T.transpose() * (raw.Er - imitation.transpose() * system.total().g);
  out.theta = out.S_inverse * score;
  out.delta = system.step() - out.B * out.theta;
  out.gain = score.dot(out.theta);
  return out;
}

Projected project(const NormalSystem& system, const std::vector<EffectColumn>& columns) {
  const EffectSums raw = system.sums(columns);
  return project(system, raw, system.inverse() * raw.JE);
}

// What the stretches say about the effect, one column each, and how much of it each one carries.
struct StretchScores {
  Eigen::MatrixXd scores;
  Eigen::VectorXd energy;
};

StretchScores stretch_scores(const NormalSystem& system, const Projected& p,
                             const std::vector<EffectSums>& raw) {
  const Eigen::Index k = p.theta.size();
  const auto stretches = static_cast<Eigen::Index>(raw.size());
  StretchScores out{Eigen::MatrixXd(k, stretches), Eigen::VectorXd(stretches)};
  // tr(S^-1 B'H B) = <B S^-1 B', H>: one pass over each stretch's H, however many columns B has.
  const Eigen::MatrixXd imitated = p.B * p.S_inverse * p.B.transpose();
  for (Eigen::Index s = 0; s < stretches; ++s) {
    const EffectSums& effect = raw[static_cast<std::size_t>(s)];
    const GroupSums& own = system.stretches()[static_cast<std::size_t>(s)];
    const Eigen::MatrixXd EE = p.T.transpose() * effect.EE * p.T;
    const Eigen::MatrixXd cross = (p.B.transpose() * effect.JE) * p.T;
    out.scores.col(s) = p.T.transpose() * (effect.Er - effect.JE.transpose() * p.delta) -
                        EE * p.theta - p.B.transpose() * (own.g - own.H * p.delta) +
                        cross * p.theta;
    out.energy[s] = p.S_inverse.cwiseProduct(EE - cross - cross.transpose()).sum() +
                    imitated.cwiseProduct(own.H).sum();
  }
  return out;
}

// The noise of the rows that the effect touches, widened for its correlation in time as if the
// effect changed slowly.
struct PooledNoise {
  double variance = 0.0;
  double freedom = 0.0;
};

PooledNoise pooled_noise(const NormalSystem& system, const Projected& p,
                         const std::vector<EffectColumn>& columns) {
  const Linearisation& linear = system.linear();
  const auto k = static_cast<double>(p.theta.size());
  const NormalSystem::Touched touched = system.touched_after(p.delta, columns, p.T * p.theta);
  // Of the model's own parameters, these rows pay their part.
  const double own = system.spent() * touched.rows / static_cast<double>(linear.residual.size());
  const double freedom = touched.rows - own - k;
  if (freedom < 1.0) return {};
  const double memory = system.memory();
  return {touched.squares / freedom * memory, std::max(1.0, freedom / memory)};
}

double effective_stretches(const Eigen::VectorXd& energy) {
  const double squares = energy.squaredNorm();
  return squares > 0.0 ? std::floor(energy.sum() * energy.sum() / squares) : 0.0;
}

// Where else the effect might have acted: by how much the residual lets its carriers move in any
// `length` stretches of the recording, as a variance of whitened rows. Errors of sensors come and
// go slowly, and one place's more slowly than the average.
PooledNoise noise_elsewhere(const NormalSystem& system, const Projected& p,
                            const std::vector<EffectColumn>& columns, int length) {
  std::vector<EffectColumn> all;
  for (const EffectColumn& column : columns) {
    if (std::ranges::find(all, column.carrier, &EffectColumn::carrier) == all.end())
      all.push_back({column.carrier, {}});
  }
  const auto n = static_cast<Eigen::Index>(all.size());
  const auto k = static_cast<Eigen::Index>(columns.size());
  all.insert(all.end(), columns.begin(), columns.end());
  const std::vector<EffectSums> stretches = system.stretch_sums(all);
  const Eigen::VectorXd theta = p.T * p.theta;
  const int windows = (system.partition().stretches + length - 1) / length;
  std::vector<Eigen::MatrixXd> S(static_cast<std::size_t>(windows), Eigen::MatrixXd::Zero(n, n));
  std::vector<Eigen::VectorXd> score(S.size(), Eigen::VectorXd::Zero(n));
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    const EffectSums& stretch = stretches[s];
    const std::size_t w = s / static_cast<std::size_t>(length);
    S[w] += stretch.EE.topLeftCorner(n, n);
    score[w] += stretch.Er.head(n) - stretch.JE.leftCols(n).transpose() * p.delta -
                stretch.EE.topRightCorner(n, k) * theta;
  }
  double squares = 0.0;
  double directions = 0.0;
  double seen = 0.0;
  for (std::size_t w = 0; w < S.size(); ++w) {
    if (!(S[w].diagonal().maxCoeff() > 0.0)) continue;
    const Eigen::VectorXd scale = unit_scale(S[w]);
    const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * S[w] * scale.asDiagonal());
    const Eigen::VectorXd along = eigen.vectors.transpose() * scale.asDiagonal() * score[w];
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!(eigen.values[i] > kHidden)) continue;
      squares += along[i] * along[i] / eigen.values[i];
      directions += 1.0;
    }
    seen += 1.0;
  }
  // Where it was fitted nothing is left. A window's directions are good or bad together (oblique
  // views, blur): each window is one witness.
  directions -= static_cast<double>(p.theta.size());
  if (directions < 1.0 || seen < 2.0) return {};
  return {squares / directions, seen - 1.0};
}

void judge(const NormalSystem& system, const Projected& p, const StretchScores& stretches,
           const Eigen::MatrixXd& covariance, const std::vector<EffectColumn>& columns,
           Score& out) {
  const auto k = static_cast<double>(p.theta.size());
  const double effective = effective_stretches(stretches.energy);
  out.rank = static_cast<int>(p.theta.size());
  out.theta = p.T * p.theta;
  out.covariance = p.T * covariance * p.T.transpose();
  out.gain = p.gain;
  const double taken = p.theta.dot(p.S * p.theta);
  out.rms = system.shift_of(taken, columns);
  out.noise_share = system.noise_share_of(taken, columns);
  out.of_one = (p.alone / std::max(taken, 1e-300)).cwiseSqrt();
  out.freedom = effective - k;
  if (effective < kFewestStretches) return;
  const bool few = out.freedom < kFewStretches;
  PooledNoise noise = few ? pooled_noise(system, p, columns) : PooledNoise{};
  if (few) {
    const PooledNoise elsewhere = noise_elsewhere(system, p, columns, static_cast<int>(effective));
    if (elsewhere.variance > noise.variance) noise = elsewhere;
  }
  if (few && !(noise.freedom > 0.0)) return;
  const double pooled_statistic = p.gain / (k * noise.variance);
  if (effective < k + 2.0) {
    // Fewer than its parameters: their scatter does not even span the effect.
    out.freedom = noise.freedom;
    out.statistic = pooled_statistic;
    out.pooled = p.T * p.S_inverse * p.T.transpose() * noise.variance;
    out.covariance = out.pooled;
    out.p_value = f_survival(out.statistic, k, out.freedom);
    return;
  }
  if (few) out.freedom = system.partition().stretches - k;
  // Of the covariance, directions that no stretch disagrees about are not certain but unknown.
  const Eigen::MatrixXd inverse = scaled_pseudo_inverse(covariance, 1e-12);
  out.statistic = p.theta.dot(inverse * p.theta) / k;
  out.p_value = f_survival(out.statistic, k, out.freedom);
  // The scatter of few stretches says little by itself, however clear the effect: then noise at its
  // usual level and memory must not explain it either.
  if (few) out.p_value = std::max(out.p_value, f_survival(pooled_statistic, k, noise.freedom));
}

// Scatter of the last `count` parameters when each stretch is left out in turn.
Eigen::MatrixXd leave_out(const NormalSystem& system, const std::vector<EffectSums>& effect,
                          Eigen::Index count) {
  const std::vector<NormalEquations> stretches = augmented(system.stretches(), effect);
  const NormalEquations total = total_of(system, stretches);
  Eigen::MatrixXd estimates(count, static_cast<Eigen::Index>(stretches.size()));
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    estimates.col(static_cast<Eigen::Index>(s)) = solve_without(total, stretches[s]).tail(count);
  }
  const Eigen::VectorXd mean = estimates.rowwise().mean();
  const Eigen::MatrixXd scatter = estimates.colwise() - mean;
  const auto m = static_cast<double>(stretches.size());
  return scatter * scatter.transpose() * (system.partition().widening * (m - 1.0) / m);
}

}  // namespace

bool is_large(const Score& score, const TraceOptions& options) {
  return score.rms >= options.floor && score.noise_share >= options.noise_floor;
}

double gain_of(const NormalSystem& system, const std::vector<EffectColumn>& columns) {
  return project(system, columns).gain;
}

std::vector<double> gains_of(const NormalSystem& system,
                             const std::vector<std::vector<EffectColumn>>& effects) {
  const std::vector<EffectSums> sums = system.sums(effects);
  Eigen::Index columns = 0;
  for (const EffectSums& effect : sums) columns += effect.JE.cols();
  Eigen::MatrixXd beside(system.parameters(), columns);
  Eigen::Index at = 0;
  for (const EffectSums& effect : sums) {
    beside.middleCols(at, effect.JE.cols()) = effect.JE;
    at += effect.JE.cols();
  }
  const Eigen::MatrixXd imitations = system.inverse() * beside;
  std::vector<double> out;
  at = 0;
  for (const EffectSums& effect : sums) {
    out.push_back(project(system, effect, imitations.middleCols(at, effect.JE.cols())).gain);
    at += effect.JE.cols();
  }
  return out;
}

Score score_test(const NormalSystem& system, const std::vector<EffectColumn>& columns) {
  const Projected p = project(system, columns);
  Score out;
  if (p.theta.size() == 0) return out;
  const StretchScores stretches = stretch_scores(system, p, system.stretch_sums(columns));
  const auto count = static_cast<double>(system.partition().stretches);
  const Eigen::MatrixXd meat = stretches.scores * stretches.scores.transpose();
  judge(system, p, stretches,
        p.S_inverse * meat * p.S_inverse * (system.partition().widening * count / (count - 1.0)),
        columns, out);
  return out;
}

Score jackknife_test(const NormalSystem& system, const std::vector<EffectColumn>& columns) {
  const Projected p = project(system, columns);
  Score out;
  if (p.theta.size() == 0) return out;
  const std::vector<EffectSums> raw = system.stretch_sums(columns);
  std::vector<EffectSums> shown;
  for (const EffectSums& stretch : raw) shown.push_back(combine(stretch, p.T));
  const Eigen::MatrixXd covariance = leave_out(system, shown, p.theta.size());
  judge(system, p, stretch_scores(system, p, raw), covariance, columns, out);
  return out;
}

Eigen::MatrixXd jackknife_covariance(const NormalSystem& system, Eigen::Index count) {
  return leave_out(system, {}, count);
}

}  // namespace kinescope::trace
