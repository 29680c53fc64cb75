// SPDX-License-Identifier: Apache-2.0
//
// What is left, beside the effects that were found: curves and fields, and what they put in doubt.
#include <algorithm>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "calib/trace/curve.h"
#include "calib/trace/field.h"
#include "calib/trace/tracer.h"
#include "calib/trace/verdict.h"

namespace kinescope::trace {
namespace {

constexpr std::size_t kMostRests = 3;

Linearisation with_rests(const Linearisation& linear, const std::vector<FoundRest>& rests) {
  Linearisation out = linear;
  for (const FoundRest& found : rests) out = extend(out, found);
  return out;
}

// True of an effect that is a straight line over what the rest is a curve over.
bool is_straight_over(const Stage& stage, const AddedEffect& effect, const Rest& rest) {
  constexpr double kStraight = 0.999;  // of correlation, squared
  const Candidate* candidate = find_candidate(stage.fit, effect.id);
  const auto over = std::ranges::find(stage.fit.covariates, rest.covariate, &Covariate::name);
  if (candidate == nullptr || candidate->is_curve() || over == stage.fit.covariates.end())
    return false;
  const std::vector<EffectColumn> columns = candidate->columns(effect.scan);
  if (columns.size() != 1 || columns.front().share.size() != over->value.size()) return false;
  const Eigen::ArrayXd share = columns.front().share.array() - columns.front().share.mean();
  const Eigen::ArrayXd value = over->value.array() - over->value.mean();
  const double product = (share * value).sum();
  return product * product > kStraight * share.square().sum() * value.square().sum();
}

}  // namespace

// Several waves at one place are what any function is made of. Where one curve in their stead
// predicts as well, or as many of them as there may be hardly better, none of them is the cause.
void Tracer::replace_waves_by_a_curve() {
  std::map<EffectId, std::vector<std::size_t>> same;
  for (std::size_t i = 0; i < now_->added.size(); ++i) same[now_->added[i].id].push_back(i);
  for (const auto& [id, members] : same) {
    if (members.size() < 2) continue;
    std::vector<AddedEffect> others = now_->added;
    std::erase_if(others, [&](const AddedEffect& effect) { return effect.id == id; });
    StagePtr stage = stage_of(std::move(others));
    const auto curve = find_rest(stage->system, stage->fit.rest_places, stage->fit.covariates, {},
                                 rest_level(), options_);
    if (!curve || !same_place(curve->rest.place, id.place)) continue;
    const double explained = stage->held_out_sum() - now_->held_out_sum();
    const double lost = curve->held_out.sum() - now_->held_out_sum();
    const bool hardly_worse =
        std::cmp_greater_equal(members.size(), kMostAlike) && lost < kSmallLoss * explained;
    if (!hardly_worse && predicts_clearly_worse(curve->held_out, now_->held_out.whitened)) continue;
    removed_.insert(id);
    mark(round_, id, CandidateState::kRemoved, stage->error.value);
    now_ = std::move(stage);
    for (std::size_t k = members.size(); k-- > 0;) {
      details_.erase(details_.begin() + static_cast<std::ptrdiff_t>(members[k]));
    }
    add_step(round_,
             fmt::format("{} waves at {} removed: a curve over {} explains as much", members.size(),
                         id.place, curve->rest.covariate),
             *now_);
    return replace_waves_by_a_curve();
  }
}

void Tracer::look_for_rest() {
  // What effects took of a rest goes back to it: from the start where one of them gives way.
  do {
    replace_waves_by_a_curve();
    look_for_curves();
  } while (look_for_field() || drop_what_rests_explain());
}

// Floors are means over all rows that an effect touches. What moves a few of them by more is found
// there as a rest; a name for it is worth more than a curve.
bool Tracer::name_the_rest() {
  if (rests_.empty()) return false;
  const std::set<EffectId> known = small_;
  for (const Candidate& candidate : now_->fit.candidates) {
    if (!std::isinf(candidate.floor)) small_.insert(candidate.id);
  }
  StagePtr named =
      refit_best(contenders(*now_, test_family(now_->system, now_->fit.candidates)), round_);
  small_ = known;
  if (!named || named->held_out_sum() > rests_.back().held_out.sum()) return false;
  const EffectId& id = named->added.back().id;
  small_.insert(id);
  now_ = std::move(named);
  mark(round_, id, CandidateState::kAccepted, now_->error.value);
  add_step(round_, fmt::format("{} says what is left", name_of(id)), *now_);
  rests_.clear();
  while (backward()) {
  }
  return true;
}

// Beside those that were found.
std::optional<FoundRest> Tracer::next_rest() const {
  if (rests_.size() >= kMostRests) return std::nullopt;
  const Linearisation linear = with_rests(now_->fit.linear, rests_);
  const NormalSystem system(linear, now_->system.partition());
  return find_rest(system, now_->fit.rest_places, now_->fit.covariates, rests_, rest_level(),
                   options_);
}

bool Tracer::choose_by_rest() {
  if (rests_.empty()) return false;
  const StagePtr now = now_;
  const std::vector<FoundRest> rests = rests_;
  for (const Ambiguity& ambiguity : trace_.ambiguities) {
    const auto chosen = std::ranges::find(now->added, ambiguity.effects.front(), &AddedEffect::id);
    if (chosen == now->added.end()) continue;
    const auto index = static_cast<std::size_t>(chosen - now->added.begin());
    const StagePtr less = stage_of(kinescope::trace::without(now->added, index));
    for (std::size_t k = 1; k < ambiguity.effects.size(); ++k) {
      const EffectId rival = ambiguity.effects[k];
      const Candidate* candidate = find_candidate(less->fit, rival);
      if (candidate == nullptr) continue;
      std::vector<AddedEffect> effects = now->added;
      effects[index] = {rival, best_scan(less->system, *candidate)};
      now_ = stage_of(std::move(effects));
      rests_.clear();
      if (now_->fit.converged && now_->held_out_sum() < now->held_out_sum() && !next_rest()) {
        needed_.insert(rival);
        add_step(round_,
                 fmt::format("{} takes the place of {}: it leaves nothing", name_of(rival),
                             name_of(now->added[index].id)),
                 *now_);
        while (backward()) {
        }
        return true;
      }
    }
  }
  now_ = now;
  rests_ = rests;
  return false;
}

void Tracer::add_rest(FoundRest found) {
  add_step(round_,
           fmt::format("structure is left at {}, over {}", found.rest.place, found.rest.covariate),
           *now_);
  rests_.push_back(std::move(found));
}

void Tracer::look_for_curves() {
  rests_.clear();
  while (std::optional<FoundRest> found = next_rest()) {
    if (rests_.empty() && rest_replaces_an_effect(*found)) continue;
    add_rest(std::move(*found));
  }
}

// Several curves stand in for what depends on a place that every row has of its own, where they
// leave some of it and a field in their stead predicts better. True where an effect gave way to the
// field.
bool Tracer::look_for_field() {
  if (!rests_.empty()) {
    const Linearisation linear = with_rests(now_->fit.linear, rests_);
    const NormalSystem beside(linear, now_->system.partition());
    if (!shows_field(beside, now_->fit.rest_fields, rest_level())) return false;
  }
  const std::optional<FoundRest> field =
      find_field(now_->system, now_->fit.rest_fields, rest_level());
  if (!field) return false;
  if (!rests_.empty() &&
      field->rest.held_out_after.value >= rests_.back().rest.held_out_after.value) {
    return false;
  }
  if (rest_replaces_an_effect(*field)) return true;
  add_step(round_,
           fmt::format("structure is left at {}, over {}{}", field->rest.place,
                       field->rest.covariate, rests_.empty() ? "" : ", in place of the curves"),
           *now_);
  rests_ = {*field};
  return false;
}

// Curves and fields share what is set aside for the rest.
double Tracer::rest_level() const { return now_->fit.rest_fields.empty() ? level_ : 0.5 * level_; }

bool Tracer::is_doubtful(const FoundRest& found, std::size_t effect) const {
  return found.rest.explained * now_->system.total().rr >=
         kDoubtfulShare * details_[effect].effect.explained * base_->system.total().rr;
}

bool Tracer::is_usual(const EffectId& id) const {
  const Candidate* candidate = find_candidate(base_->fit, id);
  return candidate != nullptr && candidate->is_usual;
}

// With all effects there are, beside curves: whether that predicts better than `less` does.
bool Tracer::predicts_beside(const std::vector<FoundRest>& curves, const NormalSystem& less) const {
  const Linearisation linear = with_rests(now_->fit.linear, curves);
  const NormalSystem system(linear, now_->system.partition());
  return held_out_instants(system).whitened.sum() < held_out_instants(less).whitened.sum();
}

// Effects that explain nothing where what is left is in the model as curves: they stood in for it,
// at whatever place.
bool Tracer::drop_what_rests_explain() {
  bool dropped = false;
  for (std::size_t i = now_->added.size(); i-- > 0;) {
    const AddedEffect effect = now_->added[i];
    // A curve at the effect's own place takes its shape, whatever that is; it puts the name in
    // doubt where it is large.
    std::vector<FoundRest> others;
    std::ranges::copy_if(rests_, std::back_inserter(others), [&](const FoundRest& found) {
      const bool elsewhere = !same_place(found.rest.place, effect.id.place);
      return (elsewhere && !is_usual(effect.id)) || is_doubtful(found, i);
    });
    if (others.empty()) continue;
    StagePtr stage = stage_of(without(now_->added, i));
    const Candidate* candidate = find_candidate(stage->fit, effect.id);
    if (candidate == nullptr) continue;
    const Linearisation linear = with_rests(stage->fit.linear, others);
    const NormalSystem system(linear, stage->system.partition());
    if (is_usual(effect.id) && predicts_beside(others, system)) continue;
    const Score score = jackknife_test(system, candidate->columns(effect.scan));
    const double tests = tests_of(stage->fit.candidates, *candidate);
    // What shrinks to less than a tenth beside the rest is no cause, however certain that is: a
    // curve in a model that has bent itself leaves some (`undeclared`, 13839).
    const double alone = details_[i].effect.explained * base_->system.total().rr;
    if (!score.hidden() && score.p_value * tests < level_ && score.gain >= kDoubtfulShare * alone)
      continue;
    take_out(i, std::move(stage), "what is left explains it too");
    dropped = true;
  }
  return dropped;
}

// Without the effect: `alone`, with further curves at the same place, beside `found` with it.
bool Tracer::says_as_much(const Stage& without, FoundRest alone, const FoundRest& found) const {
  std::vector<FoundRest> curves = {std::move(alone)};
  while (predicts_clearly_worse(curves.back().held_out, found.held_out)) {
    if (found.rest.is_field() || curves.size() >= kMostRests) return false;
    const Linearisation linear = with_rests(without.fit.linear, curves);
    const NormalSystem beside(linear, without.system.partition());
    std::optional<FoundRest> next = find_rest(
        beside, without.fit.rest_places, without.fit.covariates, curves, rest_level(), options_);
    if (!next || next->rest.place != found.rest.place) return false;
    curves.push_back(std::move(*next));
  }
  return true;
}

// An effect of the library can stand in for one that is not in it. Then one curve alone predicts
// better than a curve beside the effect; or the rest at its place is large, and curves without the
// effect predict no worse than the curve with it, or the effect is no more than the curve's slope:
// one cause, which is not that of the effect.
bool Tracer::rest_replaces_an_effect(const FoundRest& found) {
  for (std::size_t i = 0; i < now_->added.size(); ++i) {
    const EffectId id = now_->added[i].id;
    if (!same_place(found.rest.place, id.place)) continue;
    const bool doubtful = is_doubtful(found, i);
    if ((found.rest.is_field() || is_usual(id)) && !doubtful) continue;
    StagePtr stage = stage_of(without(now_->added, i));
    const auto alone = found.rest.is_field()
                           ? find_field(stage->system, stage->fit.rest_fields, rest_level())
                           : find_rest(stage->system, stage->fit.rest_places, stage->fit.covariates,
                                       {}, rest_level(), options_);
    if (!alone || alone->rest.place != found.rest.place) continue;
    // What all of its kind has stays where it predicts beside the curve, however large that is.
    const bool stays = !doubtful || is_usual(id);
    if (stays && alone->held_out.sum() >= found.held_out.sum()) continue;
    const bool is_its_slope = alone->rest.covariate == found.rest.covariate &&
                              is_straight_over(*now_, now_->added[i], found.rest);
    if (!is_its_slope && !says_as_much(*stage, *alone, found)) continue;
    take_out(i, std::move(stage),
             fmt::format("a {} over {} explains as much without it",
                         alone->rest.is_field() ? "field" : "curve", alone->rest.covariate));
    return true;
  }
  return false;
}

double Tracer::left_over() const {
  double explained = 0.0;
  for (const FoundRest& found : rests_) explained += found.rest.explained;
  return std::max(0.0, 1.0 - explained) * now_->system.total().rr;
}

// What lasts, or what bodies share from instant to instant, may be the larger part of what an
// effect stands in for (a joint that creeps, as a jump of its zero), a curve beside it or not.
bool Tracer::drop_what_leaves_too_much() {
  const double left = left_over();
  const bool lasts = over_neighbours(now_->system, left).value_or(0.0) > kLasts;
  const auto common = rests_.empty() ? common_motion(*now_) : std::nullopt;
  if (!lasts && (!common || is_of_readings(*now_, *common))) return false;
  bool dropped = false;
  for (std::size_t i = now_->added.size(); i-- > 0;) {
    const double explained = details_[i].effect.explained * base_->system.total().rr;
    if (left < kDoubtfulShare * explained) continue;
    take_out(i, stage_of(without(now_->added, i)), "what it leaves is no noise");
    dropped = true;
  }
  return dropped;
}

std::vector<LeftOver> Tracer::left_by_place() const {
  return kinescope::trace::left_over(now_->system, now_->fit.rest_places, now_->fit.covariates,
                                     level_);
}

// Of what explains more than it leaves the verdict says that it is not all; the error of a measured
// log rose by a third where that was taken out, too (`trace_torque_real lwr4`). What every joint
// has stays: it is there, whatever else is.
bool Tracer::drop_beside_what_lasts() {
  for (const LeftOver& left : left_by_place()) {
    if (!left.lasts) continue;
    const auto place = std::ranges::find(now_->fit.rest_places, left.place, &RestPlace::name);
    double squares = squares_at(now_->fit.linear, *place);
    for (const FoundRest& found : rests_) {
      if (found.rest.place == left.place) squares -= found.rest.explained * now_->system.total().rr;
    }
    for (std::size_t i = now_->added.size(); i-- > 0;) {
      const EffectId id = now_->added[i].id;
      if (!same_place(left.place, id.place) || is_usual(id)) continue;
      const double explained = details_[i].effect.explained * base_->system.total().rr;
      if (squares < explained) continue;
      std::erase_if(trace_.ambiguities,
                    [&](const Ambiguity& a) { return a.effects.front() == id; });
      take_out(i, stage_of(without(now_->added, i)), "what it leaves is no noise");
      return true;
    }
  }
  return false;
}

}  // namespace kinescope::trace
