// SPDX-License-Identifier: Apache-2.0
//
// The search as it is told: its candidates and steps, and what the effects that were found are in
// numbers.
#include <algorithm>
#include <cmath>

#include "calib/trace/curve.h"
#include "calib/trace/distribution.h"
#include "calib/trace/scan_slope.h"
#include "calib/trace/tracer.h"
#include "kinematics/core/error.h"

namespace kinescope::trace {
namespace {

// By the sign of what was found.
std::string words_of(const Candidate& candidate, const Eigen::VectorXd& values) {
  const std::string& of_sign = candidate.signed_words[values[0] < 0.0 ? 1 : 0];
  return of_sign.empty() ? candidate.words : of_sign;
}

}  // namespace

void Tracer::record(const std::vector<TestedMember>& family, const Stage& stage, int round) {
  for (const TestedMember& member : family) {
    const Candidate& candidate = stage.fit.candidates[member.index];
    TestedCandidate tested;
    tested.round = round;
    tested.id = candidate.id;
    tested.state = member.score.hidden() ? CandidateState::kHidden : CandidateState::kTested;
    tested.statistic = member.score.statistic;
    tested.parameters = static_cast<int>(candidate.parameters.size());
    tested.freedom = member.score.freedom;
    tested.p_value = member.p_value;
    tested.scan = member.scan;
    tested.size = member.score.hidden() ? 0.0 : size_of(candidate, member.score.theta);
    tested.unit = candidate.size_unit;
    tested.moves = member.score.rms;
    trace_.candidates.push_back(std::move(tested));
  }
}

void Tracer::mark(int round, const EffectId& id, CandidateState state,
                  std::optional<double> held_out) {
  for (TestedCandidate& tested : trace_.candidates) {
    if (tested.round != round || tested.id != id) continue;
    tested.state = state;
    tested.held_out = held_out;
  }
}

void Tracer::add_step(int round, std::string words, const Stage& stage) {
  trace_.steps.push_back({round, std::move(words), stage.rms(), stage.error});
}

void Tracer::size_up(std::size_t index, const Eigen::MatrixXd& covariance,
                     TracedEffect& effect) const {
  const Eigen::VectorXd& values = now_->fit.values[index];
  const Candidate& candidate = candidate_of(now_->added[index].id);
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

void Tracer::summarise() {
  trace_.found = options_.found;
  trace_.held_out_before = base_->error;
  trace_.held_out_after = rests_.empty() ? now_->error : rests_.back().rest.held_out_after;
  trace_.noise = now_->rms();
  if (const auto over = over_neighbours(now_->system, now_->system.total().rr))
    trace_.over_neighbours = *over;
  trace_.left_over = left_by_place();
  if (!trace_.left_over.empty()) trace_.over_neighbours = trace_.left_over.front().times;
  trace_.partition = now_->system.partition();
  trace_.stretches = trace_.partition.stretches;
  trace_.held_out_whitened = now_->held_out.whitened;
  for (FoundRest& found : rests_) trace_.rest.push_back(std::move(found.rest));
  Eigen::Index count = 0;
  for (const Eigen::VectorXd& values : now_->fit.values) count += values.size();
  if (count == 0) return;
  const Eigen::MatrixXd covariance = effect_covariance(*now_, count);
  const Eigen::MatrixXd posterior = posterior_covariance(now_->system, count);
  const double t = t_quantile(0.025, std::max(2.0, trace_.stretches - 1.0));
  Eigen::Index at = 0;
  for (std::size_t i = 0; i < now_->added.size(); ++i) {
    const AddedEffect& added = now_->added[i];
    const Eigen::VectorXd& values = now_->fit.values[i];
    const Candidate& candidate = candidate_of(added.id);
    TracedEffect effect = details_[i].effect;
    effect.id = added.id;
    effect.words = words_of(candidate, values);
    effect.check = candidate.check;
    effect.unit = candidate.size_unit;
    effect.scan_name = candidate.scan_name;
    effect.scan_unit = candidate.scan_unit;
    if (candidate.is_curve()) {
      effect.scan = added.scan;
      effect.covariance = posterior.block(at, at, values.size(), values.size());
      const Candidate* curve = find_candidate(now_->fit, added.id);
      KINESCOPE_CHECK(curve != nullptr, "a curve that was added is a candidate");
      size_up_curve(curve->columns(added.scan), t, effect);
    } else {
      size_up(i, covariance.block(at, at, values.size(), values.size()), effect);
    }
    at += values.size();
    trace_.accepted.push_back(std::move(effect));
    trace_.added.push_back(added);
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
