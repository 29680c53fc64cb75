// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/tracer.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "calib/trace/distribution.h"
#include "calib/trace/encompassing.h"
#include "calib/trace/picture.h"

namespace kinescope::trace {
namespace {

// A rival is looked at if it explains at least this share of what the chosen effect explains.
constexpr double kRivalShare = 0.5;
constexpr std::size_t kMostRivals = 6;
// A richer rival that explains less by this (squares, whitened: odds of e^-2) is none.
constexpr double kClearlyLess = 4.0;
// What is less than this share of the squares that were there at first may be the imperfection of
// the other effects: with all of them in it must be beyond doubt.
constexpr double kImperfection = 1e-5;
constexpr double kBeyondDoubt = 1e-4;  // of the level
// Effects that may be hidden by another one: p-values up to this, so many of them.
constexpr double kHint = 0.2;
constexpr std::size_t kMostHints = 3;
// Held-out losses further apart than this (Student's t of the stretches) need no refit to compare.
constexpr double kClearlyWorse = 3.0;

bool is_possible(const Candidate& candidate, const Eigen::VectorXd& theta) {
  return !candidate.possible || candidate.possible(theta);
}

bool refines(const Candidate& candidate, const EffectId& id) {
  return std::ranges::find(candidate.refines, id) != candidate.refines.end();
}

bool contains(const Candidate& candidate, const EffectId& id) {
  return std::ranges::find(candidate.contains, id) != candidate.contains.end();
}

std::string name_of(const EffectId& id) { return fmt::format("{} at {}", id.effect, id.place); }

}  // namespace

Tracer::Tracer(const TracedModel& model, const TraceOptions& options, const Progress& progress)
    : model_(&model),
      options_(options),
      progress_(progress),
      level_(0.5 * options.false_alarm_rate) {
  trace_.false_alarm_rate = options.false_alarm_rate;
}

Trace Tracer::run() {
  report_progress(progress_, "trace", 0, 0);
  base_ = stage_of({});
  now_ = options_.start.empty() ? base_ : stage_of(options_.start);
  if (!can_say(*now_)) return trace_;
  add_step(0, "the model as it is", *base_);
  if (now_ != base_) add_step(0, "with the effects that were known", *now_);
  do {
    forward();
  } while (backward());
  look_for_rest();
  summarise();
  list_not_found();
  conclude();
  return trace_;
}

StagePtr Tracer::stage_of(std::vector<AddedEffect> effects) {
  constexpr std::size_t kKept = 6;
  for (const StagePtr& stage : last_) {
    if (stage->added == effects) return stage;
  }
  last_.push_front(make_stage(*model_, std::move(effects)));
  if (last_.size() > kKept) last_.pop_back();
  return last_.front();
}

bool Tracer::can_say(const Stage& stage) {
  trace_.stretches = stage.system.partition().stretches;
  if (!stage.fit.converged) {
    trace_.reason = fmt::format("the model itself did not converge: {}", stage.fit.reason);
  } else if (trace_.stretches < options_.fewest_stretches) {
    trace_.reason = fmt::format(
        "{} stretches of independent data are too few to tell an effect from noise: record longer",
        trace_.stretches);
  } else if (stage.system.partition().folds < 2) {
    trace_.reason = "nothing can be held out: record more postures";
  } else {
    return true;
  }
  trace_.verdict = TraceVerdict::kNothingToSay;
  return false;
}

void Tracer::forward() {
  while (static_cast<int>(now_->added.size()) < options_.max_effects) {
    ++round_;
    report_progress(progress_, "trace", round_, 0);
    const std::vector<TestedMember> family = test_family(now_->system, now_->fit.candidates);
    record(family, *now_, round_);
    StagePtr next = refit_best(contenders(*now_, family), round_);
    if (!next) next = look_ahead(family);
    if (!next) return;
    const std::size_t before = now_->added.size();
    now_ = std::move(next);
    for (std::size_t i = before; i < now_->added.size(); ++i) {
      const EffectId& id = now_->added[i].id;
      mark(round_, id, CandidateState::kAccepted, now_->error.value);
      add_step(round_, fmt::format("{} added", name_of(id)), *now_);
    }
    search_again(now_->added.back().id.place);
  }
}

// Two effects may hide each other: what the other does is noise to each, and it lasts. The
// likeliest are tried as if they were shown; both must be, once both are in.
StagePtr Tracer::look_ahead(const std::vector<TestedMember>& family) {
  const StagePtr now = now_;
  std::vector<const TestedMember*> hints;
  for (const TestedMember& member : family) {
    const Candidate& candidate = now->fit.candidates[member.index];
    if (member.p_value <= kHint && may_be_added(candidate, member.score)) hints.push_back(&member);
  }
  std::ranges::stable_sort(hints, std::greater{},
                           [](const TestedMember* hint) { return hint->score.gain; });
  if (hints.size() > kMostHints) hints.resize(kMostHints);
  StagePtr best;
  for (const TestedMember* hint : hints) {
    std::vector<AddedEffect> effects = now->added;
    effects.push_back({now->fit.candidates[hint->index].id, hint->scan});
    now_ = stage_of(effects);
    StagePtr both;
    if (now_->fit.converged)
      both = refit_best(contenders(*now_, test_family(now_->system, now_->fit.candidates)), round_);
    now_ = now;
    if (!both || (best && both->held_out_sum() >= best->held_out_sum())) continue;
    const StagePtr second = stage_of(kinescope::trace::without(both->added, now->added.size()));
    const Candidate* first = find_candidate(second->fit, effects.back().id);
    if (first == nullptr || !is_possible(*first, both->fit.values[now->added.size()])) continue;
    const Score shown = jackknife_test(second->system, first->columns(hint->scan));
    if (shown.p_value * number_of_tests(second->fit.candidates, *first) > level_) continue;
    if (second->held_out_sum() > both->held_out_sum()) best = std::move(both);
  }
  return best;
}

// The value of a scan was the best beside the effects that were known then. Everywhere, or at one
// place.
void Tracer::search_again(const std::optional<std::string>& place) {
  constexpr double kNoticeable = 1e-6;  // of what the effect explains
  for (std::size_t i = 0; i < now_->added.size(); ++i) {
    const AddedEffect effect = now_->added[i];
    if (place && effect.id.place != *place) continue;
    const Candidate* known = find_candidate(base_->fit, effect.id);
    if (known == nullptr || known->scan.empty()) continue;
    const StagePtr stage = stage_of(kinescope::trace::without(now_->added, i));
    const Candidate* candidate = find_candidate(stage->fit, effect.id);
    if (candidate == nullptr) continue;
    const double scan = best_scan(stage->system, *candidate);
    const double before = gain_of(stage->system, candidate->columns(effect.scan));
    if (gain_of(stage->system, candidate->columns(scan)) <= (1.0 + kNoticeable) * before) continue;
    std::vector<AddedEffect> effects = now_->added;
    effects[i].scan = scan;
    StagePtr moved = stage_of(std::move(effects));
    if (moved->fit.converged && moved->held_out_sum() < now_->held_out_sum()) {
      now_ = std::move(moved);
    }
  }
}

bool Tracer::may_be_added(const Candidate& candidate, const Score& score) const {
  return !score.hidden() && score.rms >= std::max(options_.floor, candidate.floor) &&
         !removed_.contains(candidate.id) && is_possible(candidate, score.theta);
}

std::vector<Tracer::Contender> Tracer::contenders(const Stage& stage,
                                                  const std::vector<TestedMember>& family) const {
  std::vector<Contender> out;
  for (const TestedMember& member : family) {
    const Candidate& candidate = stage.fit.candidates[member.index];
    if (member.p_value > level_ || !may_be_added(candidate, member.score)) continue;
    const EffectId& id = candidate.id;
    const Score confirmed = jackknife_test(stage.system, member.columns);
    if (confirmed.p_value * member.tests > level_) continue;
    out.push_back({member, id, held_out_cells(stage.system, member.columns)});
  }
  const std::vector<Contender> all = out;
  std::erase_if(out, [&](const Contender& contender) {
    const Candidate& candidate = stage.fit.candidates[contender.member.index];
    return std::ranges::any_of(
        all, [&](const Contender& other) { return refines(candidate, other.id); });
  });
  std::ranges::stable_sort(out, {},
                           [](const Contender& contender) { return contender.held_out.sum(); });
  return out;
}

StagePtr Tracer::refit_best(const std::vector<Contender>& contenders, int round) {
  StagePtr best;
  int refits = 0;
  for (const Contender& contender : contenders) {
    if (refits >= options_.refits) break;
    const bool clearly_worse = best && paired_t(now_->system.partition(), contender.held_out,
                                                contenders.front().held_out) > kClearlyWorse;
    if (clearly_worse) break;
    ++refits;
    std::vector<AddedEffect> effects = now_->added;
    effects.push_back({contender.id, contender.member.scan});
    StagePtr stage = stage_of(std::move(effects));
    mark(round, contender.id, CandidateState::kRefitted, stage->error.value);
    const double bar = best ? best->held_out_sum() : now_->held_out_sum();
    if (stage->fit.converged && stage->held_out_sum() < bar) best = std::move(stage);
  }
  return best;
}

// Several effects at one place may stand for a single one that the search passed by.
bool Tracer::simplify() {
  std::map<std::string, std::vector<std::size_t>> places;
  for (std::size_t i = 0; i < now_->added.size(); ++i) {
    places[now_->added[i].id.place].push_back(i);
  }
  for (const auto& [place, members] : places) {
    if (members.size() < 2) continue;
    std::vector<AddedEffect> others;
    for (const AddedEffect& effect : now_->added) {
      if (effect.id.place != place) others.push_back(effect);
    }
    const StagePtr stage = stage_of(others);
    std::optional<AddedEffect> best;
    double least = 0.0;
    for (const Contender& contender :
         contenders(*stage, test_family(stage->system, stage->fit.candidates))) {
      const bool known = std::ranges::any_of(
          members, [&](std::size_t i) { return now_->added[i].id == contender.id; });
      const double loss = contender.held_out.sum();
      if (contender.id.place != place || known || (best && loss >= least)) continue;
      best = AddedEffect{contender.id, contender.member.scan};
      least = loss;
    }
    if (!best) continue;
    others.push_back(*best);
    StagePtr single = stage_of(std::move(others));
    if (!single->fit.converged || single->held_out_sum() > now_->held_out_sum()) continue;
    for (const std::size_t i : members) removed_.insert(now_->added[i].id);
    mark(round_, best->id, CandidateState::kAccepted, single->error.value);
    now_ = std::move(single);
    add_step(round_,
             fmt::format("{} takes the place of {} effects at {}", best->id.effect, members.size(),
                         place),
             *now_);
    return true;
  }
  return false;
}

bool Tracer::backward() {
  if (simplify()) return true;
  search_again(std::nullopt);
  details_.assign(now_->added.size(), {});
  trace_.ambiguities.clear();
  if (drop_without_size()) return true;
  // The latest first: an early one may have stood for several that came after it.
  for (std::size_t i = 0; i < now_->added.size(); ++i) {
    if (check(i)) return true;
  }
  return false;
}

// An effect that bends the model can be significant where it is absent and of no certain size where
// it is fitted: a gain of 7 that may be -5.
bool Tracer::drop_without_size() {
  Eigen::Index count = 0;
  for (const Eigen::VectorXd& values : now_->fit.values) count += values.size();
  if (count == 0) return false;
  const Eigen::MatrixXd covariance = jackknife_covariance(now_->system, count);
  const double t = t_quantile(0.025, std::max(2.0, now_->system.partition().stretches - 1.0));
  std::optional<std::size_t> weakest;
  double least = t;
  Eigen::Index at = 0;
  for (std::size_t i = 0; i < now_->added.size(); ++i) {
    const Eigen::VectorXd& values = now_->fit.values[i];
    const double variance = covariance(at, at);
    at += values.size();
    if (values.size() > 1 || !(variance > 0.0)) continue;
    const double ratio = std::abs(values[0]) / std::sqrt(variance);
    if (ratio >= least) continue;
    least = ratio;
    weakest = i;
  }
  if (!weakest) return false;
  const EffectId id = now_->added[*weakest].id;
  removed_.insert(id);
  now_ = stage_of(kinescope::trace::without(now_->added, *weakest));
  mark(round_, id, CandidateState::kRemoved, now_->error.value);
  add_step(round_, fmt::format("{} removed: its size may be nothing", name_of(id)), *now_);
  return true;
}

bool Tracer::check(std::size_t index) {
  const AddedEffect effect = now_->added[index];
  const StagePtr stage = stage_of(kinescope::trace::without(now_->added, index));
  const Candidate* candidate = find_candidate(stage->fit, effect.id);
  if (candidate == nullptr) return false;
  TestedMember own;
  own.scan = effect.scan;
  own.columns = candidate->columns(effect.scan);
  own.score = jackknife_test(stage->system, own.columns);
  own.tests = number_of_tests(stage->fit.candidates, *candidate);
  own.p_value = std::min(1.0, own.score.p_value * own.tests);
  TracedEffect& detail = details_[index];
  detail.p_value = own.p_value;
  detail.held_out_before = stage->error;
  detail.held_out_after = now_->error;
  detail.explained =
      (stage->system.total().rr - now_->system.total().rr) / base_->system.total().rr;
  // What clearly helps to predict stays, however few stretches judge its parameters.
  const bool needed = paired_t(now_->system.partition(), stage->held_out.whitened,
                               now_->held_out.whitened) > kClearlyWorse;
  const bool slight = now_->added.size() > 1 && detail.explained < kImperfection;
  const bool shown =
      slight ? own.p_value <= kBeyondDoubt * level_ : own.p_value <= level_ || needed;
  const bool possible = is_possible(*candidate, now_->fit.values[index]);
  const bool large = own.score.rms >= std::max(options_.floor, candidate->floor);
  if (!possible || !large || !shown || stage->held_out_sum() < now_->held_out_sum()) {
    removed_.insert(effect.id);
    mark(round_, effect.id, CandidateState::kRemoved, stage->error.value);
    now_ = stage_of(kinescope::trace::without(now_->added, index));
    add_step(round_,
             fmt::format("{} removed: with the others in, it earns nothing", name_of(effect.id)),
             *now_);
    return true;
  }
  detail.picture = picture_of(*stage, *now_, *candidate, own);
  return settle_rivals(index, *stage, own);
}

// Puts another effect in the place of one; for good where the other makes it superfluous.
bool Tracer::swap(std::size_t index, const AddedEffect& other, bool superfluous) {
  const EffectId id = now_->added[index].id;
  std::vector<AddedEffect> effects = now_->added;
  effects[index] = other;
  StagePtr swapped = stage_of(std::move(effects));
  if (!swapped->fit.converged) return false;
  // What says the same predicts as well, within its own doubt.
  const double bar = superfluous ? now_->error.value : now_->error.interval.high;
  if (swapped->error.value >= bar) return false;
  if (superfluous) removed_.insert(id);
  mark(round_, id, CandidateState::kRemoved, now_->error.value);
  mark(round_, other.id, CandidateState::kAccepted, swapped->error.value);
  now_ = std::move(swapped);
  add_step(round_,
           fmt::format("{} takes the place of {}{}", name_of(other.id), name_of(id),
                       superfluous ? ", which it makes superfluous" : ": plainer, and as good"),
           *now_);
  return true;
}

bool Tracer::settle_rivals(std::size_t index, const Stage& without, const TestedMember& own) {
  const AddedEffect effect = now_->added[index];
  std::vector<TestedMember> rivals;
  const double least_gain = kRivalShare * own.score.gain;
  for (TestedMember& member : test_family(without.system, without.fit.candidates, least_gain)) {
    const Candidate& candidate = without.fit.candidates[member.index];
    const bool in_model = std::ranges::any_of(
        now_->added, [&](const AddedEffect& added) { return added.id == candidate.id; });
    if (in_model || member.p_value > level_ || !may_be_added(candidate, member.score)) continue;
    // What it says beyond the effect, the forward search would have found.
    if (refines(candidate, effect.id) || contains(candidate, effect.id)) continue;
    if (member.score.gain < least_gain) continue;
    rivals.push_back(std::move(member));
  }
  std::ranges::stable_sort(rivals, std::greater{},
                           [](const TestedMember& rival) { return rival.score.gain; });
  if (rivals.size() > kMostRivals) rivals.resize(kMostRivals);
  Ambiguity ambiguity;
  for (const TestedMember& rival : rivals) {
    const Candidate& candidate = without.fit.candidates[rival.index];
    const Comparison comparison = compare_effects(without.system, own.columns, rival.columns);
    if (comparison == Comparison::kFirst) continue;
    const bool richer = rival.columns.size() > own.columns.size();
    if (comparison == Comparison::kInterchangeable && richer &&
        rival.score.gain <= own.score.gain - kClearlyLess) {
      continue;
    }
    // Of two that say the same the plainer one comes first.
    const bool plainer = rival.columns.size() < own.columns.size();
    if (comparison == Comparison::kSecond || plainer) {
      if (swap(index, {candidate.id, rival.scan}, comparison == Comparison::kSecond)) return true;
    }
    if (comparison == Comparison::kSecond) continue;
    ambiguity.effects.push_back(candidate.id);
    ambiguity.words.push_back(candidate.words);
    if (ambiguity.record.empty()) ambiguity.record = candidate.record;
  }
  if (ambiguity.effects.empty()) return false;
  const Candidate* chosen = find_candidate(without.fit, effect.id);
  ambiguity.effects.insert(ambiguity.effects.begin(), effect.id);
  ambiguity.words.insert(ambiguity.words.begin(), chosen->words);
  if (ambiguity.record.empty()) ambiguity.record = chosen->record;
  trace_.ambiguities.push_back(std::move(ambiguity));
  return false;
}

}  // namespace kinescope::trace
