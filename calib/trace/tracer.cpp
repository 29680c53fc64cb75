// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/tracer.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "calib/trace/distribution.h"
#include "calib/trace/not_found.h"
#include "calib/trace/scan_slope.h"
#include "calib/trace/verdict.h"
#include "kinematics/core/error.h"
#include "kinematics/core/parallel_for.h"

namespace kinescope::trace {
namespace {

// Of the squares that are left: what explains as much may be one of several that hide each other.
constexpr double kLargeShare = 0.05;
constexpr int kLongestChain = 5;

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
  // From the model's own start, which may have in it what they do; not from where it ends without.
  now_ = stage_of(options_.start);
  known_searched_ = options_.start.empty();
  base_ = stage_of({});
  if (can_look(*now_)) search();
  const int rounds = std::max(1, round_);
  report_progress(progress_, "trace", rounds, rounds);
  return trace_;
}

std::optional<AddedEffect> Tracer::first() {
  now_ = stage_of(options_.start);
  const StagePtr next =
      refit_best(contenders(*now_, test_family(now_->system, now_->fit.candidates)), round_);
  return next ? std::optional(next->added.back()) : std::nullopt;
}

void Tracer::search() {
  add_step(0, std::string(kModelAsItIs), *base_);
  if (now_ != base_) add_step(0, "with the effects that were known", *now_);
  begin_with_what_is_expected();
  for (bool again = true; again;) {
    forward();
    if (is_ended_) return say_nothing("the search was ended");
    again = backward();
    if (options_.about && !is_added(*options_.about))
      return say_nothing(fmt::format("{} is not shown", name_of(*options_.about)));
    if (!again && look_ahead_put_off_) {
      checked_ = now_;
      again = true;
    }
  }
  if (!may_go_on())
    add_step(round_, fmt::format("nothing more is looked for after {} fits", fits_), *now_);
  if (!now_->fit.converged) {
    trace_.converged = false;
    say_nothing(fmt::format("the model itself did not converge: {}", now_->fit.reason));
    return;
  }
  do {
    look_for_rest();
  } while (name_the_rest() || name_by_plain_causes() || choose_by_rest() ||
           drop_what_leaves_too_much() || drop_beside_what_lasts());
  take_a_curve_for_what_cancels();
  while (take_the_rest_as_curves()) look_beside_curves();
  describe_curves();
  summarise();
  trace_.not_found = not_found(*now_, trace_, options_, level_);
  conclude(*now_, base_->system.total().rr, trace_);
}

StagePtr Tracer::stage_of(std::vector<AddedEffect> effects) {
  constexpr std::size_t kKept = 6;
  for (const StagePtr& stage : last_) {
    if (stage->added == effects) return stage;
  }
  ++fits_;
  last_.push_front(make_stage(*model_, std::move(effects)));
  if (last_.size() > kKept) last_.pop_back();
  return last_.front();
}

void Tracer::say_nothing(std::string reason) {
  trace_.verdict = TraceVerdict::kNothingToSay;
  trace_.reason = std::move(reason);
}

// A model that did not converge may be one that lacks something large: then its linearisation shows
// that, too, and with it in the model converges.
bool Tracer::can_look(const Stage& stage) {
  trace_.stretches = stage.system.partition().stretches;
  if (trace_.stretches < options_.fewest_stretches) {
    say_nothing(fmt::format(
        "{} stretches of independent data are too few to tell an effect from noise: record longer",
        trace_.stretches));
    return false;
  }
  if (stage.system.partition().folds < 2) {
    say_nothing("nothing can be held out: record more postures");
    return false;
  }
  return true;
}

void Tracer::begin_with_what_is_expected() {
  constexpr double kLarge = 0.5;  // of the noise of the rows that it touches; chosen
  std::vector<AddedEffect> effects = now_->added;
  std::string names;
  for (const Candidate& candidate : now_->fit.candidates) {
    if (candidate.expected.size() == 0 || is_added(candidate.id)) continue;
    const std::vector<EffectColumn> columns = candidate.columns(0.0);
    const double squares = now_->system.moved_by(columns, candidate.expected).squaredNorm();
    if (now_->system.noise_share_of(squares, columns) < kLarge) continue;
    effects.push_back({candidate.id, 0.0});
    names += (names.empty() ? "" : ", ") + name_of(candidate.id);
  }
  if (names.empty()) return;
  StagePtr begun = stage_of(std::move(effects));
  if (!begun->fit.converged) return;
  now_ = std::move(begun);
  add_step(0, fmt::format("with {}, which the readings show", names), *now_);
}

bool Tracer::is_added(const EffectId& id) const {
  return std::ranges::find(now_->added, id, &AddedEffect::id) != now_->added.end();
}

const Candidate& Tracer::candidate_of(const EffectId& id) const {
  const Candidate* candidate = find_candidate(now_->fit, id);
  if (candidate == nullptr) candidate = find_candidate(base_->fit, id);
  KINESCOPE_CHECK(candidate != nullptr, "an added effect is a candidate");
  return *candidate;
}

bool Tracer::may_go_on() const { return options_.most_fits == 0 || fits_ < options_.most_fits; }

bool Tracer::predicts_clearly_worse(const Eigen::VectorXd& one,
                                    const Eigen::VectorXd& other) const {
  return trace::predicts_clearly_worse(now_->system.partition(), one, other);
}

void Tracer::forward() {
  look_ahead_put_off_ = false;
  while (static_cast<int>(now_->added.size()) < options_.max_effects && may_go_on()) {
    ++round_;
    report_progress(progress_, "trace", round_, 0);
    const std::vector<TestedMember> family = test_family(now_->system, now_->fit.candidates);
    record(family, *now_, round_);
    StagePtr next = refit_best(contenders(*now_, family), round_);
    if (next && !known_searched_) {
      // Sightings chosen since may say when or where better: a jump at the wrong time leaves what
      // looks like another one (`undeclared`, 13845).
      known_searched_ = true;
      if (search_again(std::nullopt)) continue;
    }
    if (!next && search_again_for_a_second(family)) continue;
    if (next) next = or_what_is_below_floors(std::move(next), family);
    // What hides behind others is looked for where all of these are beyond doubt: the backward
    // check takes out the others first.
    look_ahead_put_off_ = !next && now_ != checked_ && one_without_size();
    if (!next && !look_ahead_put_off_) {
      next = look_ahead(family);
      if (next && is_of_the_sensor(*next, family)) return;
    }
    if (!next) return;
    const std::size_t before = now_->added.size();
    now_ = std::move(next);
    for (std::size_t i = before; i < now_->added.size(); ++i) {
      const EffectId& id = now_->added[i].id;
      mark(round_, id, CandidateState::kAccepted, now_->error.value);
      add_step(round_, fmt::format("{} added", name_of(id)), *now_);
    }
    is_ended_ = options_.until && options_.until(now_->added);
    if (is_ended_) return;
    std::set<std::string> places;
    for (std::size_t i = before; i < now_->added.size(); ++i)
      places.insert(now_->added[i].id.place);
    for (const std::string& place : places) static_cast<void>(search_again(place));
  }
}

// Two effects may hide each other: what the other does is noise to each, and it lasts. The
// likeliest are tried as if they were shown; both must be, once both are in.
StagePtr Tracer::look_ahead(const std::vector<TestedMember>& family) {
  const StagePtr now = now_;
  std::vector<const TestedMember*> hints;
  for (const TestedMember& member : family) {
    const Candidate& candidate = now->fit.candidates[member.index];
    if (member.p_value <= kHint && may_be_added(candidate, member.scan, member.score))
      hints.push_back(&member);
  }
  std::ranges::stable_sort(hints, std::greater{},
                           [](const TestedMember* hint) { return hint->score.gain; });
  if (hints.size() > kMostHints) hints.resize(kMostHints);
  StagePtr best;
  for (const TestedMember* hint : hints) {
    if (!may_go_on()) return best;
    if (!shows_another(*now, *hint)) continue;
    std::vector<AddedEffect> effects = now->added;
    effects.push_back({now->fit.candidates[hint->index].id, hint->scan});
    now_ = with_sizes_for_scans(stage_of(effects));
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
  if (best) return best;
  // Where what is left is no noise for certain, too few stretches may be free of it to show
  // anything at all.
  if (hints.empty() &&
      over_neighbours(now->system, now->system.total().rr).value_or(0.0) > kLasts) {
    if (const TestedMember* most = most_telling(*now, family)) hints.push_back(most);
  }
  for (const TestedMember* hint : hints) {
    if (hint->score.gain < kLargeShare * now->system.total().rr) continue;
    StagePtr several = chain({now->fit.candidates[hint->index].id, hint->scan});
    if (several && (!best || several->held_out_sum() < best->held_out_sum()))
      best = std::move(several);
  }
  return best;
}

bool Tracer::shows_another(const Stage& stage, const TestedMember& hint) const {
  const Linearisation beside = extend(stage.fit.linear, hint.columns, {});
  const NormalSystem system(beside, stage.system.partition());
  const std::vector<Candidate>& candidates = stage.fit.candidates;
  return !contenders(system, candidates, test_family(system, candidates)).empty();
}

// What is below the floors is not looked for, but it is there, and others may stand in for it.
const TestedMember* Tracer::most_below_floors(const std::vector<TestedMember>& family) const {
  const TestedMember* below = nullptr;
  for (const TestedMember& member : family) {
    const Candidate& candidate = now_->fit.candidates[member.index];
    const bool counts = member.p_value <= level_ && !member.score.hidden() &&
                        !is_large(candidate, member.scan, member.score) &&
                        !removed_.contains(candidate.id);
    if (counts && (below == nullptr || member.score.gain > below->score.gain)) below = &member;
  }
  return below;
}

StagePtr Tracer::with(const TestedMember& member) {
  std::vector<AddedEffect> effects = now_->added;
  effects.push_back({now_->fit.candidates[member.index].id, member.scan});
  return stage_of(std::move(effects));
}

bool Tracer::is_of_the_sensor(const Stage& found, const std::vector<TestedMember>& family) {
  const TestedMember* below = most_below_floors(family);
  if (below == nullptr) return false;
  const StagePtr stage = with(*below);
  return stage->fit.converged && stage->held_out_sum() <= found.held_out_sum();
}

// A name for what is small is better than another one for it.
StagePtr Tracer::or_what_is_below_floors(StagePtr found, const std::vector<TestedMember>& family) {
  const TestedMember* below = most_below_floors(family);
  const double gain = now_->system.total().rr - found->system.total().rr;
  if (below == nullptr || below->score.gain < gain) return found;
  const Candidate& candidate = now_->fit.candidates[below->index];
  if (std::isinf(candidate.floor)) return found;
  StagePtr stage = with(*below);
  if (!stage->fit.converged || stage->held_out_sum() >= found->held_out_sum() ||
      !is_possible(candidate, stage->fit.values.back()))
    return found;
  small_.insert(candidate.id);
  return stage;
}

StagePtr Tracer::without_idle(StagePtr stage, std::size_t known) {
  for (std::size_t i = stage->added.size(); i-- > known;) {
    if (held_out_sum_without(*stage, i) > stage->held_out_sum()) continue;
    StagePtr less = stage_of(kinescope::trace::without(stage->added, i));
    if (!less->fit.converged || less->held_out_sum() > stage->held_out_sum()) continue;
    stage = std::move(less);
    i = stage->added.size();
  }
  return stage;
}

// One that is not needed decides: what the linear model says is needed least comes first.
bool Tracer::all_needed(const Stage& stage, std::size_t known) {
  std::vector<std::pair<double, std::size_t>> order;  // squares held out without it, index
  for (std::size_t i = known; i < stage.added.size(); ++i)
    order.emplace_back(held_out_sum_without(stage, i), i);
  std::ranges::sort(order);
  return std::ranges::all_of(order, [&](const auto& one) { return is_needed(stage, one.second); });
}

bool Tracer::is_needed(const Stage& stage, std::size_t index) {
  const StagePtr less = stage_of(kinescope::trace::without(stage.added, index));
  const Candidate* candidate = find_candidate(less->fit, stage.added[index].id);
  if (candidate == nullptr || !is_possible(*candidate, stage.fit.values[index])) return false;
  const double p_value = std::min(
      paired_p_value(stage.system.partition(), less->held_out.whitened, stage.held_out.whitened),
      lost_p_value(*less, stage, static_cast<double>(stage.fit.values[index].size())));
  return p_value * number_of_tests(less->fit.candidates, *candidate) <= level_;
}

const TestedMember* Tracer::most_telling(const Stage& stage,
                                         const std::vector<TestedMember>& family) const {
  const TestedMember* best = nullptr;
  for (const TestedMember& member : family) {
    if (!may_be_added(stage.fit.candidates[member.index], member.scan, member.score)) continue;
    if (best == nullptr || member.score.gain > best->score.gain) best = &member;
  }
  return best;
}

// Large effects together last so long that hardly a stretch is free of any of them, and each is
// noise to the others.
StagePtr Tracer::chain(const AddedEffect& first) {
  const StagePtr now = now_;
  const std::size_t known = now->added.size();
  std::vector<AddedEffect> effects = now->added;
  effects.push_back(first);
  StagePtr found;
  double last = now->held_out_sum();
  for (int step = 0; step < kLongestChain && may_go_on(); ++step) {
    StagePtr stage = with_sizes_for_scans(stage_of(effects));
    if (!stage->fit.converged || stage->held_out_sum() >= last) break;
    stage = without_idle(std::move(stage), known);
    effects = stage->added;
    if (effects.size() <= known) break;
    last = stage->held_out_sum();
    if (all_needed(*stage, known)) {
      found = stage;
      break;
    }
    now_ = stage;
    const std::vector<TestedMember> family = test_family(stage->system, stage->fit.candidates);
    const TestedMember* best = most_telling(*stage, family);
    if (best == nullptr || best->score.gain < kLargeShare * stage->system.total().rr) break;
    effects.push_back({stage->fit.candidates[best->index].id, best->scan});
  }
  now_ = now;
  return found;
}

// The value of a scan was the best beside the effects that were known then. All values are tried
// everywhere, or at one place; a step from where it is costs little and is taken everywhere.
bool Tracer::search_again(const std::optional<std::string>& place) {
  constexpr double kNoticeable = 1e-6;  // of what the effect explains
  const StagePtr before = now_;
  for (std::size_t i = 0; i < now_->added.size() && may_go_on(); ++i) {
    const AddedEffect effect = now_->added[i];
    if (place && effect.id.place != *place) continue;
    const Candidate* known = find_candidate(base_->fit, effect.id);
    if (known == nullptr || known->scan.empty()) continue;
    const StagePtr stage = stage_of(kinescope::trace::without(now_->added, i));
    const Candidate* candidate = find_candidate(stage->fit, effect.id);
    if (candidate == nullptr) continue;
    const double scan = best_scan(stage->system, *candidate);
    const double gain = gain_of(stage->system, candidate->columns(effect.scan));
    if (gain_of(stage->system, candidate->columns(scan)) <= (1.0 + kNoticeable) * gain) continue;
    std::vector<AddedEffect> effects = now_->added;
    effects[i].scan = scan;
    StagePtr moved = with_sizes_for_scans(stage_of(std::move(effects)));
    if (moved->fit.converged && moved->held_out_sum() < now_->held_out_sum()) {
      now_ = std::move(moved);
    }
  }
  for (std::size_t i = 0; i < now_->added.size(); ++i) sharpen(i);
  return now_->held_out_sum() < before->held_out_sum();
}

// Play turns round at once: what is left has a kink wherever the gap is as wide as a reversal, and
// the search along it ends in one of many lesser minima (1.6 % from the width, `undeclared`, 9725).
// What the model says there and nowhere else, a jump seems to explain.
StagePtr Tracer::with_sizes_for_scans(StagePtr stage) {
  constexpr int kMostSteps = 3;  // 1.6 % of the gap moved the width by 0.04 % (9725)
  // Of the value: widths are known to 1.4e-4 at best (`undeclared`, 10138).
  constexpr double kSmallStep = 3e-4;
  for (std::size_t i = 0; i < stage->added.size(); ++i) {
    const Candidate* candidate = find_candidate(stage->fit, stage->added[i].id);
    if (candidate == nullptr || !candidate->scan_is_size) continue;
    for (int k = 0; k < kMostSteps && stage->fit.converged; ++k) {
      const double size = size_of(*candidate, stage->fit.values[i]);
      if (!(size > 0.0) || std::abs(size - stage->added[i].scan) < kSmallStep * size) break;
      std::vector<AddedEffect> effects = stage->added;
      effects[i].scan = size;
      StagePtr moved = stage_of(std::move(effects));
      if (!moved->fit.converged ||
          predicts_clearly_worse(moved->held_out.whitened, stage->held_out.whitened))
        break;
      stage = std::move(moved);
      candidate = find_candidate(stage->fit, stage->added[i].id);
    }
  }
  return stage;
}

// Without a large effect the model has bent itself, and its linearisation is not where the scan's
// best value is. With the effect in, a few Gauss-Newton steps are exact.
void Tracer::sharpen(std::size_t index) {
  constexpr int kMostSteps = 5;
  constexpr double kSmallStep = 0.1;     // standard deviations of the scan
  constexpr double kLargestStep = 0.25;  // of the value
  for (int k = 0; k < kMostSteps && may_go_on(); ++k) {
    const std::optional<Eigen::VectorXd> slope = scan_slope(*now_, index);
    const auto step = slope ? scan_step(now_->system, *slope) : std::nullopt;
    if (!step || std::abs(step->step) < kSmallStep * step->sigma) break;
    std::vector<AddedEffect> effects = now_->added;
    double& scan = effects[index].scan;
    const double most = kLargestStep * std::abs(scan);
    scan += std::clamp(step->step, -most, most);
    StagePtr moved = stage_of(std::move(effects));
    if (!moved->fit.converged || moved->system.total().rr >= now_->system.total().rr) break;
    now_ = std::move(moved);
  }
  now_ = with_sizes_for_scans(now_);
}

bool Tracer::is_large(const Candidate& candidate, double scan, const Score& score) const {
  const double at_scan = candidate.floor_at ? candidate.floor_at(scan) : 0.0;
  if (std::isinf(at_scan)) return false;  // not to be seen, by whatever else
  return small_.contains(candidate.id) ||
         (score.rms >= std::max(candidate.floor, at_scan) && trace::is_large(score, options_));
}

bool Tracer::may_be_added(const Candidate& candidate, double scan, const Score& score) const {
  return !score.hidden() && is_large(candidate, scan, score) && !removed_.contains(candidate.id) &&
         is_possible(candidate, score.theta) &&
         std::ranges::count(now_->added, candidate.id, &AddedEffect::id) <
             (candidate.is_single ? 1 : kMostAlike);
}

bool Tracer::search_again_for_a_second(const std::vector<TestedMember>& family) {
  for (const TestedMember& member : family) {
    const Candidate& candidate = now_->fit.candidates[member.index];
    if (candidate.is_single && is_added(candidate.id) && member.p_value <= level_ &&
        search_again(candidate.id.place))
      return true;
  }
  return false;
}

std::vector<Tracer::Contender> Tracer::contenders(const NormalSystem& system,
                                                  const std::vector<Candidate>& candidates,
                                                  const std::vector<TestedMember>& family) const {
  std::vector<std::optional<Contender>> found(family.size());
  parallel_for(family.size(), [&](std::size_t k) {
    const TestedMember& member = family[k];
    const Candidate& candidate = candidates[member.index];
    if (member.p_value > level_ || !may_be_added(candidate, member.scan, member.score)) return;
    const Score confirmed = jackknife_test(system, member.columns);
    if (confirmed.p_value * member.tests > level_) return;
    found[k] = {member, candidate.id, held_out_instants(system, member.columns).whitened};
  });
  std::vector<Contender> out;
  for (std::optional<Contender>& one : found) {
    if (one) out.push_back(std::move(*one));
  }
  const std::vector<Contender> all = out;
  std::erase_if(out, [&](const Contender& contender) {
    const Candidate& candidate = candidates[contender.member.index];
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
  const Contender* last = nullptr;
  for (const Contender& contender : contenders) {
    // The same columns under two names (a delay, a low-pass): only refits tell, of one direction.
    const bool same = last != nullptr && last->held_out == contender.held_out;
    if (refits >= options_.refits && !same) break;
    last = &contender;
    if (best && predicts_clearly_worse(contender.held_out, contenders.front().held_out)) break;
    if (!same) ++refits;
    std::vector<AddedEffect> effects = now_->added;
    effects.push_back({contender.id, contender.member.scan});
    StagePtr stage = with_sizes_for_scans(stage_of(std::move(effects)));
    mark(round, contender.id, CandidateState::kRefitted, stage->error.value);
    const double bar = best ? best->held_out_sum() : now_->held_out_sum();
    // What the residual asks for in a straight line may end where no such effect is.
    const Candidate* candidate = find_candidate(now_->fit, contender.id);
    if (candidate == nullptr || !is_possible(*candidate, stage->fit.values.back())) continue;
    if (stage->fit.converged && stage->held_out_sum() < bar) best = std::move(stage);
  }
  return best;
}

}  // namespace kinescope::trace
