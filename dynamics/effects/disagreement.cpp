// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/disagreement.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/trace/distribution.h"

namespace kinescope::effects {
namespace {

constexpr double kVague = 0.5;  // standard deviation beyond which a joint says nothing

/// How much of the load each joint shows, 1 being what all of them together say; its variance.
struct Share {
  double value = 1.0;
  double variance = 0.0;
};

double gain_of(const Trace& trace, const std::string& joint) {
  for (const TracedEffect& effect : trace.accepted) {
    if (effect.id == EffectId{"torque_gain", joint}) return 1.0 + effect.values[0].value;
  }
  return 1.0;
}

/// Whitened torque of an effect, row by row.
Eigen::VectorXd rows_of(const Linearisation& linear, const std::vector<EffectColumn>& columns,
                        const std::vector<EffectValue>& values) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(linear.residual.size());
  for (std::size_t k = 0; k < columns.size(); ++k) {
    out += values[k].value * linear.carriers.col(columns[k].carrier);
  }
  return out;
}

std::vector<Share> shares_of(const TorqueTracedModel& model, const Trace& trace,
                             const Linearisation& linear, const Eigen::VectorXd& load) {
  const Eigen::Index joints = model.motion().joints();
  const double step_s = (linear.time_s[linear.instants() - 1] - linear.time_s[0]) /
                        static_cast<double>(std::max<Eigen::Index>(1, linear.instants() - 1));
  const double memory = std::max(1.0, 2.0 * linear.correlation_time_s / step_s);
  std::vector<Share> out;
  for (Eigen::Index j = 0; j < joints; ++j) {
    const auto own = Eigen::seqN(j, linear.instants(), joints);
    const Eigen::VectorXd torque = load(own);
    const double energy = torque.squaredNorm();
    if (!(energy > 0.0)) continue;
    const Eigen::VectorXd left = linear.residual(own);
    const double gain = gain_of(trace, model.context().joints[static_cast<std::size_t>(j)]);
    const double noise = left.squaredNorm() / static_cast<double>(linear.instants());
    const Share share{gain + left.dot(torque) / energy, memory * noise / energy};
    if (share.variance < kVague * kVague) out.push_back(share);
  }
  return out;
}

/// Variance that the shares have in common beyond their own.
double variance_between(const std::vector<Share>& shares) {
  double weights = 0.0, squares = 0.0, mean = 0.0;
  for (const Share& share : shares) {
    weights += 1.0 / share.variance;
    squares += 1.0 / (share.variance * share.variance);
    mean += share.value / share.variance;
  }
  mean /= weights;
  double scatter = 0.0;
  for (const Share& share : shares) scatter += std::pow(share.value - mean, 2) / share.variance;
  const double excess = scatter - (static_cast<double>(shares.size()) - 1.0);
  return std::max(0.0, excess / (weights - squares / weights));
}

/// Of their mean, beyond what it is without the variance between them.
double added_variance(const std::vector<Share>& shares) {
  const double between = variance_between(shares);
  double with = 0.0, without = 0.0;
  for (const Share& share : shares) {
    with += 1.0 / (share.variance + between);
    without += 1.0 / share.variance;
  }
  return 1.0 / with - 1.0 / without;
}

}  // namespace

void widen_by_disagreement(const TorqueTracedModel& model, Trace& trace) {
  const bool any = std::ranges::any_of(
      trace.accepted, [](const TracedEffect& e) { return e.id.effect == "payload"; });
  if (!any) return;
  const TracedFit fit = model.fit(trace.added);
  const TracedFit bare = model.fit({});
  for (TracedEffect& effect : trace.accepted) {
    if (effect.id.effect != "payload") continue;
    const auto candidate = std::ranges::find(bare.candidates, effect.id, &Candidate::id);
    if (candidate == bare.candidates.end()) continue;
    const Eigen::VectorXd load = rows_of(fit.linear, candidate->columns(0.0), effect.values);
    const std::vector<Share> shares = shares_of(model, trace, fit.linear, load);
    if (shares.size() < 2) continue;
    const double t = trace::t_quantile(0.025, static_cast<double>(shares.size()) - 1.0);
    const double half = 0.5 * (effect.interval.high - effect.interval.low);
    const double wider =
        std::hypot(half, t * effect.size * std::sqrt(std::max(0.0, added_variance(shares))));
    effect.interval = {effect.size - wider, effect.size + wider};
    if (effect.size > 0.0) effect.interval.low = std::max(0.0, effect.interval.low);
  }
}

}  // namespace kinescope::effects
