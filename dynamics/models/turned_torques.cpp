// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/turned_torques.h"

#include <algorithm>
#include <cmath>

#include "dynamics/data/splits.h"
#include "dynamics/models/bands.h"
#include "dynamics/models/torque_model.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr int kMostTurnedSamples = 1000;
constexpr int kTurnedFolds = 8;
// Sigmas from which on friction clearly takes energy: 5 % for seven joints together, Student's t of
// 20 blocks. A turned torque would have it drive.
constexpr double kDissipates = 2.7;

TorqueSamples with_turned(TorqueSamples samples, const std::vector<int>& joints) {
  for (const int joint : joints) samples.torque.col(joint) *= -1.0;
  return samples;
}

struct LogLikelihood {
  double of_a_sample = 0.0;
  double samples = 0.0;      // independent ones
  Eigen::VectorXd friction;  // Coulomb's of each joint in sigmas; 0 where it is not determined
};

Eigen::VectorXd friction_in_sigmas(const Identification& found, Eigen::Index joints) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(joints);
  for (std::size_t k = 0; k < found.basis.kept.size(); ++k) {
    const TorqueTerm& term = found.terms[static_cast<std::size_t>(found.basis.kept[k])];
    const auto at = static_cast<Eigen::Index>(k);
    const double sigma = found.sigma_of(at);
    if (term.kind == TermKind::kCoulomb && sigma > 0.0) {
      out[term.index] = found.parameters[at] / sigma;
    }
  }
  return out;
}

LogLikelihood log_likelihood(const DynamicModel& model, const TorqueSamples& samples,
                             const IdentifyOptions& options) {
  const Identification found = identify_dynamics(model, samples, options);
  LogLikelihood out;
  for (const double sigma : found.sigma) {
    if (sigma > 0.0) out.of_a_sample -= std::log(sigma);
  }
  out.friction = friction_in_sigmas(found, samples.joints());
  out.samples = static_cast<double>(samples.size()) / std::max(1.0, found.correlation_samples);
  return out;
}

TorqueSamples some_of(const TorqueSamples& samples) {
  return select_rows(samples, evenly_chosen(samples.size(), kMostTurnedSamples));
}

double gain(const LogLikelihood& turned, const LogLikelihood& as_logged) {
  return (turned.of_a_sample - as_logged.of_a_sample) * std::min(turned.samples, as_logged.samples);
}

/// Log of the errors of all joints' torques, summed, on each fold that was left out of the fit.
std::vector<double> left_out_errors(const DynamicModel& model, const TorqueSamples& samples,
                                    const IdentifyOptions& options) {
  const auto left = leave_folds_out(
      samples, kTurnedFolds, 0, [&](const TorqueSamples& train, const TorqueSamples& test) {
        return predict_torque(identify_dynamics(model, train, options), test.q, test.dq, test.ddq);
      });
  if (!left) return {};
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(left->folds, samples.joints());
  for (Eigen::Index i = 0; i < left->residual.rows(); ++i) {
    squares.row(left->fold[i]) += left->residual.row(i).cwiseAbs2();
  }
  std::vector<double> out;
  for (int f = 0; f < left->folds; ++f) out.push_back(0.5 * squares.row(f).array().log().sum());
  return out;
}

/// A model whose geometry is wrong may fit turned torques better by chance: they must predict
/// better, too (paired over the folds, one-sided t test at 1 %).
bool predicts_better(const DynamicModel& model, const TorqueSamples& turned,
                     const TorqueSamples& as_logged, const IdentifyOptions& options) {
  constexpr double kSignificant = 3.0;  // Student's t of 7 degrees of freedom
  const std::vector<double> before = left_out_errors(model, as_logged, options);
  const std::vector<double> after = left_out_errors(model, turned, options);
  if (before.size() < 2 || after.size() != before.size()) return false;
  const Eigen::ArrayXd gains = Eigen::ArrayXd::Map(before.data(), std::ssize(before)) -
                               Eigen::ArrayXd::Map(after.data(), std::ssize(after));
  const auto count = static_cast<double>(gains.size());
  const double variance = (gains - gains.mean()).square().sum() / (count - 1.0);
  return gains.mean() > kSignificant * std::sqrt(variance / count);
}

std::vector<int> turned_in(const DynamicModel& model, const TorqueSamples& samples,
                           const IdentifyOptions& options) {
  const auto joints = static_cast<int>(samples.joints());
  std::vector<int> turned;
  LogLikelihood now = log_likelihood(model, samples, options);
  while (2 * (std::ssize(turned) + 1) < joints) {
    int best = -1;
    LogLikelihood better;
    double most = clear_evidence(joints);
    for (int j = 0; j < joints; ++j) {
      if (std::ranges::count(turned, j) > 0 || now.friction[j] > kDissipates) continue;
      std::vector<int> more = turned;
      more.push_back(j);
      const LogLikelihood other = log_likelihood(model, with_turned(samples, more), options);
      if (gain(other, now) <= most) continue;
      most = gain(other, now);
      best = j;
      better = other;
    }
    if (best < 0) break;
    std::vector<int> more = turned;
    more.push_back(best);
    if (!predicts_better(model, with_turned(samples, more), with_turned(samples, turned),
                         options)) {
      break;
    }
    turned.push_back(best);
    now = better;
  }
  std::ranges::sort(turned);
  return turned;
}

}  // namespace

double clear_evidence(Eigen::Index joints) {
  constexpr double kChance = 1e-3;
  return std::log(static_cast<double>(std::max<Eigen::Index>(1, joints)) / kChance);
}

double evidence_of_turning(const DynamicModel& model, const TorqueSamples& samples,
                           const IdentifyOptions& options, const std::vector<int>& joints) {
  const TorqueSamples few = some_of(samples);
  return gain(log_likelihood(model, with_turned(few, joints), options),
              log_likelihood(model, few, options));
}

std::vector<int> find_turned_torques(const DynamicModel& model, const TorqueSamples& samples,
                                     const IdentifyOptions& options) {
  if (samples.joints() < 2) return {};
  try {
    return turned_in(model, some_of(samples), options);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return {};
  }
}

}  // namespace kinescope
