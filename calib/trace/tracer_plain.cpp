// SPDX-License-Identifier: Apache-2.0
//
// What is left at one place and has a plain cause there: structure that a curve has shown to exist
// is no search over the whole library any more, only a question of its name.
#include <algorithm>

#include <fmt/format.h>

#include "calib/trace/tracer.h"

namespace kinescope::trace {
namespace {

bool is_plain(const Candidate& candidate, const std::string& place) {
  return candidate.id.place == place && candidate.scan.empty() && !candidate.is_curve();
}

double plain_causes_at(const std::vector<Candidate>& candidates, const std::string& place) {
  return static_cast<double>(
      std::ranges::count_if(candidates, [&](const Candidate& c) { return is_plain(c, place); }));
}

}  // namespace

double Tracer::tests_of(const std::vector<Candidate>& candidates,
                        const Candidate& candidate) const {
  return plain_.contains(candidate.id) ? plain_causes_at(candidates, candidate.id.place)
                                       : number_of_tests(candidates, candidate);
}

// What refines another waits for it.
std::optional<AddedEffect> Tracer::plainest_at(const Stage& stage, const std::string& place) const {
  const auto in_model = [&](const EffectId& id) {
    return std::ranges::find(stage.added, id, &AddedEffect::id) != stage.added.end();
  };
  std::optional<AddedEffect> best;
  double most = 0.0;
  for (const Candidate& candidate : stage.fit.candidates) {
    if (!is_plain(candidate, place) || in_model(candidate.id)) continue;
    if (!std::ranges::all_of(candidate.refines, in_model)) continue;
    const Score score = score_test(stage.system, candidate.columns(0.0));
    if (!may_be_added(candidate, 0.0, score) || score.gain <= most) continue;
    most = score.gain;
    best = AddedEffect{candidate.id};
  }
  return best;
}

// With all of them in, beside the tests of their own place.
bool Tracer::all_shown(const Stage& stage, std::size_t known) {
  for (std::size_t i = known; i < stage.added.size(); ++i) {
    const StagePtr less = stage_of(kinescope::trace::without(stage.added, i));
    const Candidate* candidate = find_candidate(less->fit, stage.added[i].id);
    if (candidate == nullptr || !is_possible(*candidate, stage.fit.values[i])) return false;
    const double tests = plain_causes_at(less->fit.candidates, candidate->id.place);
    const Score score = jackknife_test(less->system, candidate->columns(0.0));
    if (score.hidden() || score.p_value * tests > level_) return false;
  }
  return true;
}

// Nearly all of what the curve explains: the rest of it puts no name in doubt.
StagePtr Tracer::plain_causes_of(const FoundRest& found) {
  const Linearisation with_curve = extend(now_->fit.linear, found);
  const NormalSystem system(with_curve, now_->system.partition());
  const double curve = held_out_instants(system).whitened.sum();
  StagePtr stage = now_;
  for (int k = 0; k < options_.plain_causes; ++k) {
    const auto next = plainest_at(*stage, found.rest.place);
    if (!next) break;
    std::vector<AddedEffect> effects = stage->added;
    effects.push_back(*next);
    StagePtr more = stage_of(std::move(effects));
    if (!more->fit.converged || more->held_out_sum() >= stage->held_out_sum()) break;
    stage = std::move(more);
    const double left = stage->held_out_sum() - curve;
    const double explained = now_->held_out_sum() - stage->held_out_sum();
    if (left < kDoubtfulShare * explained && all_shown(*stage, now_->added.size())) return stage;
  }
  return nullptr;
}

bool Tracer::name_by_plain_causes() {
  for (const FoundRest& found : rests_) {
    if (found.rest.is_field()) continue;
    StagePtr named = plain_causes_of(found);
    if (!named) continue;
    const std::size_t known = now_->added.size();
    now_ = std::move(named);
    for (std::size_t i = known; i < now_->added.size(); ++i) {
      const EffectId& id = now_->added[i].id;
      plain_.insert(id);
      mark(round_, id, CandidateState::kAccepted, now_->error.value);
      add_step(round_, fmt::format("{} says what is left", name_of(id)), *now_);
    }
    rests_.clear();
    while (backward()) {
    }
    return true;
  }
  return false;
}

}  // namespace kinescope::trace
