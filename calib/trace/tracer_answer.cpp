// SPDX-License-Identifier: Apache-2.0
//
// The second half of the search: what is left, and the answer as it is handed on.
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "calib/trace/curve.h"
#include "calib/trace/distribution.h"
#include "calib/trace/field.h"
#include "calib/trace/lasting_body.h"
#include "calib/trace/scan_slope.h"
#include "calib/trace/tracer.h"

namespace kinescope::trace {
namespace {

constexpr std::size_t kMostRests = 3;
// Less than this of what named effects explain at its place is the imperfection of their shapes.
constexpr double kSlightShare = 1e-3;
// Of what is left: more than that is no error of single bodies.
constexpr double kMostOfIt = 0.5;

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

bool same_place(const std::string& rest, const std::string& effect) {
  return rest == effect || rest.starts_with(effect + " ") || effect.starts_with(rest + " ");
}

// By the sign of what was found.
std::string words_of(const Candidate& candidate, const Eigen::VectorXd& values) {
  const std::string& of_sign = candidate.signed_words[values[0] < 0.0 ? 1 : 0];
  return of_sign.empty() ? candidate.words : of_sign;
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
    if (!score.hidden() && score.p_value * tests < level_) continue;
    removed_.insert(effect.id);
    mark(round_, effect.id, CandidateState::kRemoved, stage->error.value);
    now_ = std::move(stage);
    details_.erase(details_.begin() + static_cast<std::ptrdiff_t>(i));
    add_step(round_, fmt::format("{} removed: what is left explains it too", name_of(effect.id)),
             *now_);
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
    removed_.insert(id);
    mark(round_, id, CandidateState::kRemoved, stage->error.value);
    now_ = std::move(stage);
    add_step(round_,
             fmt::format("{} removed: a {} over {} explains as much without it", name_of(id),
                         alone->rest.is_field() ? "field" : "curve", alone->rest.covariate),
             *now_);
    details_.erase(details_.begin() + static_cast<std::ptrdiff_t>(i));
    return true;
  }
  return false;
}

std::optional<double> Tracer::over_neighbours(double squares) const {
  if (!now_->fit.linear.whitened_by_neighbours) return std::nullopt;
  return std::sqrt(squares / now_->system.freedom());
}

std::optional<CommonMotion> Tracer::common_motion() const {
  const auto found = find_common_motion(now_->system, now_->fit.rest_places, now_->fit.clock);
  return found && found->share > kMostOfIt ? found : std::nullopt;
}

bool Tracer::is_of_readings(const CommonMotion& motion) const {
  const RestPlace& place = now_->fit.rest_places[motion.place];
  return motion.size >= place.reading_error_least && motion.size <= place.reading_error_most;
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
  const bool lasts = over_neighbours(left).value_or(0.0) > kLasts;
  const auto common = rests_.empty() ? common_motion() : std::nullopt;
  if (!lasts && (!common || is_of_readings(*common))) return false;
  bool dropped = false;
  for (std::size_t i = now_->added.size(); i-- > 0;) {
    const double explained = details_[i].effect.explained * base_->system.total().rr;
    if (left < kDoubtfulShare * explained) continue;
    const EffectId id = now_->added[i].id;
    removed_.insert(id);
    now_ = stage_of(without(now_->added, i));
    details_.erase(details_.begin() + static_cast<std::ptrdiff_t>(i));
    mark(round_, id, CandidateState::kRemoved, now_->error.value);
    add_step(round_, fmt::format("{} removed: what it leaves is no noise", name_of(id)), *now_);
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
      removed_.insert(id);
      std::erase_if(trace_.ambiguities,
                    [&](const Ambiguity& a) { return a.effects.front() == id; });
      now_ = stage_of(without(now_->added, i));
      details_.erase(details_.begin() + static_cast<std::ptrdiff_t>(i));
      mark(round_, id, CandidateState::kRemoved, now_->error.value);
      add_step(round_, fmt::format("{} removed: what it leaves is no noise", name_of(id)), *now_);
      return true;
    }
  }
  return false;
}

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

void Tracer::summarise() {
  trace_.found = options_.found;
  trace_.held_out_before = base_->error;
  trace_.held_out_after = rests_.empty() ? now_->error : rests_.back().rest.held_out_after;
  trace_.noise = now_->rms();
  if (const auto over = over_neighbours(now_->system.total().rr)) trace_.over_neighbours = *over;
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
    const Candidate& candidate = *find_candidate(base_->fit, added.id);
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
      size_up_curve(find_candidate(now_->fit, added.id)->columns(added.scan), t, effect);
    } else {
      size_up(i, covariance.block(at, at, values.size(), values.size()), effect);
    }
    at += values.size();
    trace_.accepted.push_back(std::move(effect));
    trace_.added.push_back(added);
  }
}

namespace {

// The size of an effect that does as much as the one that was fitted. Where that is nothing but
// noise, its direction is an accident: one parameter alone, in the mean over those that count.
double typical_size(const Candidate& candidate, const Score& score) {
  if (candidate.size || score.theta.size() == 1) return std::abs(size_of(candidate, score.theta));
  double squares = 0.0;
  double counted = 0.0;
  for (Eigen::Index i = 0; i < score.theta.size(); ++i) {
    const double weight = candidate.size_weights[i];
    if (!(weight > 0.0) || !(score.of_one[i] > 0.0)) continue;
    squares += weight / (score.of_one[i] * score.of_one[i]);
    counted += 1.0;
  }
  return std::sqrt(squares / std::max(1.0, counted));
}

// Nobody overlooks an effect that large: from here on the recording is no test of it.
bool beyond_possible(const Candidate& candidate, const Score& score, double smallest_size) {
  const double size = std::abs(size_of(candidate, score.theta));
  if (!candidate.possible || !(size > 0.0)) return false;
  const Eigen::VectorXd theta = score.theta * (smallest_size / size);
  return !candidate.possible(theta) && !candidate.possible(-theta);
}

}  // namespace

void Tracer::list_not_found() {
  for (const TestedMember& member : test_family(now_->system, now_->fit.candidates)) {
    const Candidate& candidate = now_->fit.candidates[member.index];
    const bool named =
        std::ranges::any_of(trace_.accepted,
                            [&](const TracedEffect& e) { return e.id == candidate.id; }) ||
        std::ranges::any_of(trace_.ambiguities, [&](const Ambiguity& a) {
          return std::ranges::find(a.effects, candidate.id) != a.effects.end();
        });
    if (named) continue;
    // A scan's best value is an accident where there is nothing; its middle is typical.
    const Score score =
        candidate.scan.empty()
            ? member.score
            : score_test(now_->system,
                         candidate.columns(candidate.scan[candidate.scan.size() / 2]));
    const bool hidden = score.hidden() || std::isinf(candidate.floor);
    NotFoundEffect missing{candidate.id, hidden, 0.0, candidate.size_unit, ""};
    if (missing.hidden) {
      missing.record = candidate.record;
    } else {
      // What lies below the sensor's own errors is not looked for.
      double least_size = 0.0;
      if (score.rms > 0.0) {
        const double floor = std::max(options_.floor, candidate.floor);
        least_size = typical_size(candidate, score) *
                     std::max(floor / score.rms, options_.noise_floor / score.noise_share);
      }
      missing.smallest_size = smallest_size(candidate, score, level_ / member.tests, least_size);
      if (beyond_possible(candidate, score, missing.smallest_size))
        missing = {candidate.id, true, 0.0, candidate.size_unit, candidate.record};
    }
    trace_.not_found.push_back(std::move(missing));
  }
}

bool Tracer::is_slight(const Rest& rest) const {
  double named = 0.0;
  for (const TracedEffect& effect : trace_.accepted) {
    if (same_place(rest.place, effect.id.place)) named += effect.explained;
  }
  return rest.explained * now_->system.total().rr < kSlightShare * named * base_->system.total().rr;
}

namespace {

// "the error of joint2, joint3 repeats with its value"; empty without curves.
std::string curve_words(const std::vector<TracedEffect>& accepted) {
  std::string names;
  for (const TracedEffect& effect : accepted) {
    if (!effect.is_curve() || names.find(effect.id.place) != std::string::npos) continue;
    names += (names.empty() ? "" : ", ") + effect.id.place;
  }
  return names.empty() ? names : fmt::format("the error of {} repeats with its value", names);
}

}  // namespace

std::string Tracer::reading_words(const CommonMotion& motion) const {
  const RestPlace& place = now_->fit.rest_places[motion.place];
  return fmt::format(
      "readings of {} are uncertain by {:.2g} {} (rms), as their steps or their noise say: {:.0f} "
      "% "
      "of what is left",
      place.name, motion.size, place.unit, 100.0 * std::min(1.0, motion.share));
}

std::string Tracer::lasting_body_words() const {
  const Linearisation& linear = now_->fit.linear;
  if (!linear.whitened_by_neighbours) return "";
  const auto found = find_lasting_body(linear, now_->system.freedom(), kLasts);
  if (!found || std::cmp_greater_equal(found->body, linear.body_names.size())) return "";
  return fmt::format(
      "what {} leaves, {:.3g} {}, is {:.1f} times what it differs by from one frame to the next: "
      "it lasts, and no known effect explains it",
      linear.body_names[static_cast<std::size_t>(found->body)], found->rms, linear.unit_name,
      found->over_differences);
}

void Tracer::conclude() {
  const bool slight =
      std::ranges::all_of(trace_.rest, [&](const Rest& rest) { return is_slight(rest); });
  if (slight) trace_.held_out_after = now_->error;  // without curves
  const std::optional<CommonMotion> common = slight ? common_motion() : std::nullopt;
  const std::string lasting = lasting_words(trace_.left_over);
  const std::string beyond = trace_.accepted.empty()
                                 ? ""
                                 : found_words(options_.found, trace_.accepted) + "; beyond that ";
  const std::string of_a_body = lasting_body_words();
  if (!slight) {
    trace_.verdict = TraceVerdict::kUnknown;
    trace_.reason = fmt::format("structure is left at {}, over {}, that no known effect explains",
                                trace_.rest.front().place, trace_.rest.front().covariate);
    if (!lasting.empty()) trace_.reason += "; without that curve, what is left is " + lasting;
  } else if (const std::string curves = curve_words(trace_.accepted); !curves.empty()) {
    trace_.verdict = TraceVerdict::kUnknown;
    trace_.reason = fmt::format(
        "{}, for a reason that no known effect has the shape of; it is part of the model as it is",
        curves);
  } else if (!lasting.empty()) {
    trace_.verdict = TraceVerdict::kUnknown;
    trace_.reason =
        fmt::format("{}what is left is {}: no known effect explains it", beyond, lasting);
  } else if (now_->fit.linear.whitened_by_neighbours && trace_.over_neighbours > kLasts) {
    trace_.verdict = TraceVerdict::kUnknown;
    trace_.reason = fmt::format(
        "{}what is left, {:.3g} {}, is {:.1f} times what differs from one frame to the next: it "
        "lasts, and no known effect explains it",
        beyond, trace_.held_out_after.value, trace_.held_out_after.unit, trace_.over_neighbours);
  } else if (common && !is_of_readings(*common)) {
    const RestPlace& place = now_->fit.rest_places[common->place];
    trace_.verdict = TraceVerdict::kUnknown;
    trace_.reason = fmt::format(
        "{}all that {} moves differs alike from instant to instant, by {:.3g} {} of it (rms), "
        "which makes {:.0f} % of what is left: a vibration or unsteady readings, that no known "
        "effect "
        "explains",
        beyond, place.name, common->size, place.unit, 100.0 * std::min(1.0, common->share));
  } else if (!of_a_body.empty()) {
    trace_.verdict = TraceVerdict::kUnknown;
    trace_.reason = beyond + of_a_body;
  } else if (!trace_.ambiguities.empty()) {
    trace_.verdict = TraceVerdict::kAmbiguous;
    const Ambiguity& first = trace_.ambiguities.front();
    std::string names;
    for (const EffectId& id : first.effects) {
      names += (names.empty() ? "" : " or ") + name_of(id);
    }
    trace_.reason = fmt::format("{}: this recording cannot tell them apart", names);
  } else if (!trace_.accepted.empty()) {
    trace_.verdict = TraceVerdict::kEffects;
    trace_.reason = found_words(options_.found, trace_.accepted);
    for (const Rest& rest : trace_.rest) {
      trace_.reason += fmt::format(
          "; what is left at {} over {} is less than a thousandth of what they explain there",
          rest.place, rest.covariate);
    }
    if (common) trace_.reason += "; " + reading_words(*common);
  } else {
    trace_.verdict = TraceVerdict::kClean;
    trace_.reason = fmt::format("the error on unseen data, {:.3g} {}, is noise",
                                trace_.held_out_after.value, trace_.held_out_after.unit);
    if (common) trace_.reason += ": " + reading_words(*common);
  }
}

}  // namespace kinescope::trace
