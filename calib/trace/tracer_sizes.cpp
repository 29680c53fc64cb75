// SPDX-License-Identifier: Apache-2.0
//
// What the effects that were found are in numbers.
#include <algorithm>
#include <cmath>

#include "calib/trace/distribution.h"
#include "calib/trace/scan_slope.h"
#include "calib/trace/tracer.h"

namespace kinescope::trace {

void Tracer::size_up(std::size_t index, const Eigen::MatrixXd& covariance,
                     TracedEffect& effect) const {
  const Eigen::VectorXd& values = now_->fit.values[index];
  const Candidate& candidate = *find_candidate(base_->fit, now_->added[index].id);
  effect.scan = now_->added[index].scan;
  if (candidate.scan_words) effect.scan_words = candidate.scan_words(effect.scan);
  effect.size = size_of(candidate, values);
  const double stretches = now_->system.partition().stretches;
  double half =
      t_quantile(0.025, std::max(2.0, stretches - 1.0)) * size_sigma(candidate, values, covariance);
  // Where few stretches carry the effect their scatter may be small by chance.
  const Score& score = details_[index].score;
  if (score.pooled.size() > 0) {
    half = std::max(half, t_quantile(0.025, std::max(2.0, score.freedom)) *
                              size_sigma(candidate, values, score.pooled));
  }
  effect.interval = {effect.size - half, effect.size + half};
  for (const ScanAlternative& other : effect.as_likely) {
    effect.interval.low = std::min(effect.interval.low, other.size.low);
    effect.interval.high = std::max(effect.interval.high, other.size.high);
  }
  // Of most effects of several parameters it is a length.
  if (values.size() > 1 && effect.size > 0.0)
    effect.interval.low = std::max(0.0, effect.interval.low);
  effect.values.clear();
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    effect.values.push_back({candidate.parameters[static_cast<std::size_t>(k)], values[k],
                             std::sqrt(std::max(0.0, covariance(k, k)))});
  }
}

void Tracer::size_again(Trace& found) {
  base_ = stage_of({});
  now_ = stage_of(found.added);
  if (!now_->fit.converged) return;
  for (std::size_t i = 0; i < now_->added.size(); ++i) sharpen(i);
  details_.assign(now_->added.size(), {});
  Eigen::Index count = 0;
  for (const Eigen::VectorXd& values : now_->fit.values) count += values.size();
  const Eigen::MatrixXd covariance = effect_covariance(*now_, count);
  Eigen::Index at = 0;
  for (std::size_t i = 0; i < now_->added.size(); ++i) {
    const AddedEffect before = found.added[i];
    found.added[i] = now_->added[i];
    const Eigen::Index n = now_->fit.values[i].size();
    const Eigen::MatrixXd block = covariance.block(at, at, n, n);
    at += n;
    const auto effect = std::ranges::find_if(found.accepted, [&](const TracedEffect& one) {
      return one.id == before.id && one.scan == before.scan;
    });
    if (effect == found.accepted.end()) continue;
    const StagePtr without = stage_of(kinescope::trace::without(now_->added, i));
    if (const Candidate* candidate = find_candidate(without->fit, before.id))
      details_[i].score = jackknife_test(without->system, candidate->columns(found.added[i].scan));
    size_up(i, block, *effect);
  }
}

}  // namespace kinescope::trace
