// SPDX-License-Identifier: Apache-2.0
//
// The search backwards: does every effect still earn its place, what says the same, what cannot be
// told apart.
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "calib/trace/distribution.h"
#include "calib/trace/encompassing.h"
#include "calib/trace/picture.h"
#include "calib/trace/scan_slope.h"
#include "calib/trace/tracer.h"

namespace kinescope::trace {
namespace {

// A rival is looked at if it explains at least this share of what the chosen effect explains.
constexpr double kRivalShare = 0.5;
constexpr std::size_t kMostRivals = 6;
constexpr double kSameGain = 1e-9;  // of two columns that are one: rounding
// What is less than this share of the squares that were there at first may be the imperfection of
// the other effects: with all of them in it must be beyond doubt.
constexpr double kImperfection = 1e-5;
constexpr double kBeyondDoubt = 1e-4;  // of the level

// How far an effect moves the prediction, by what the fit lost without it.
Score refitted_score(const Stage& without, const Stage& with,
                     const std::vector<EffectColumn>& columns) {
  const double gain = without.system.total().rr - with.system.total().rr;
  Score out;
  out.rms = without.system.shift_of(gain, columns);
  out.noise_share = without.system.noise_share_of(gain, columns);
  return out;
}

// Directions that the data show of it, and the value of a scan that is searched.
double freedom_of(const Candidate& candidate, const Score& score) {
  const bool searched = !candidate.scan.empty() && !candidate.scan_listed;
  return score.rank + (searched ? 1.0 : 0.0);
}

}  // namespace

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
  for (std::size_t i = 0; i < now_->added.size(); ++i) sharpen(i);
  // All values of all scans cost more than to see that an effect is not needed.
  do {
    details_.assign(now_->added.size(), {});
    trace_.ambiguities.clear();
    if (drop_without_size()) return true;
    for (std::size_t i = 0; i < now_->added.size(); ++i) {
      if (check(i)) return true;
    }
  } while (search_again(std::nullopt));
  return false;
}

// An effect that bends the model can be significant where it is absent and of no certain size where
// it is fitted: a gain of 7 that may be -5, a camera that turned by 0.5 deg or by nothing. Several
// parameters may be uncertain one by one and yet predict, and a size may be uncertain only because
// its scan is (how far and how fast a zero drifts): such effects stay if they clearly predict.
std::optional<std::size_t> Tracer::one_without_size() {
  std::vector<Eigen::Index> first;  // parameter of every effect
  Eigen::Index all = 0;
  for (const Eigen::VectorXd& values : now_->fit.values) {
    first.push_back(all);
    all += values.size();
  }
  if (all == 0) return std::nullopt;
  const double t = t_quantile(0.025, std::max(2.0, now_->system.partition().stretches - 1.0));
  const auto in_sigmas = [&](std::size_t i, const Eigen::MatrixXd& covariance) {
    const Eigen::VectorXd& values = now_->fit.values[i];
    const Candidate& candidate = candidate_of(now_->added[i].id);
    const double sigma = size_sigma(
        candidate, values, covariance.block(first[i], first[i], values.size(), values.size()));
    return sigma > 0.0 ? std::abs(size_of(candidate, values)) / sigma : t;
  };
  std::vector<std::pair<double, std::size_t>> weak;  // size in sigmas, index
  const Eigen::MatrixXd with_scans = effect_covariance(*now_, all);
  for (std::size_t i = 0; i < now_->added.size(); ++i) {
    if (candidate_of(now_->added[i].id).is_curve()) continue;  // its prior says it may be nothing
    const double ratio = in_sigmas(i, with_scans);
    if (ratio < t) weak.emplace_back(ratio, i);
  }
  if (weak.empty()) return std::nullopt;
  std::ranges::sort(weak);
  const Eigen::MatrixXd as_scanned = jackknife_covariance(now_->system, all);
  for (const auto& [ratio, index] : weak) {
    if (now_->fit.values[index].size() == 1 && in_sigmas(index, as_scanned) < t) return index;
    const StagePtr less = stage_of(kinescope::trace::without(now_->added, index));
    if (!predicts_clearly_worse(less->held_out.whitened, now_->held_out.whitened)) return index;
  }
  return std::nullopt;
}

void Tracer::take_out(std::size_t index, StagePtr less, std::string_view why) {
  const EffectId id = now_->added[index].id;
  removed_.insert(id);
  mark(round_, id, CandidateState::kRemoved, less->error.value);
  now_ = std::move(less);
  details_.erase(details_.begin() + static_cast<std::ptrdiff_t>(index));
  add_step(round_, fmt::format("{} removed: {}", name_of(id), why), *now_);
}

bool Tracer::drop_without_size() {
  const std::optional<std::size_t> index = one_without_size();
  if (!index) return false;
  take_out(*index, stage_of(kinescope::trace::without(now_->added, *index)),
           "its size may be nothing");
  return true;
}

void Tracer::compare_without(const Stage& without, TracedEffect& detail) const {
  detail.held_out_before = without.error;
  detail.held_out_after = now_->error;
  detail.explained =
      (without.system.total().rr - now_->system.total().rr) / base_->system.total().rr;
}

std::vector<ScanAlternative> Tracer::as_likely(const Stage& without, const Candidate& candidate,
                                               const TestedMember& own) const {
  // The interval that covers them holds the truth in 19 of 20.
  const double least_odds = -2.0 * std::log(19.0);
  std::vector<ScanAlternative> out;
  if (!candidate.scan_listed) return out;
  for (const double scan : candidate.scan) {
    if (scan == own.scan) continue;
    const std::vector<EffectColumn> columns = candidate.columns(scan);
    if (score_test(without.system, columns).gain < kRivalShare * own.score.gain) continue;
    const Score score = jackknife_test(without.system, columns);
    if (score.hidden() || !is_possible(candidate, score.theta) ||
        odds_of_second(without.system, {own.columns}, {columns}) < least_odds) {
      continue;
    }
    const double size = size_of(candidate, score.theta);
    const double half = t_quantile(0.025, std::max(2.0, score.freedom)) *
                        size_sigma(candidate, score.theta, score.covariance);
    out.push_back(
        {scan, candidate.scan_words ? candidate.scan_words(scan) : "", {size - half, size + half}});
  }
  return out;
}

bool Tracer::check(std::size_t index) {
  const AddedEffect effect = now_->added[index];
  const StagePtr stage = stage_of(kinescope::trace::without(now_->added, index));
  const Candidate* candidate = find_candidate(stage->fit, effect.id);
  if (candidate == nullptr) return false;
  TestedMember own;
  own.index = static_cast<std::size_t>(candidate - stage->fit.candidates.data());
  own.scan = effect.scan;
  own.columns = candidate->columns(effect.scan);
  own.score = jackknife_test(stage->system, own.columns);
  own.tests = tests_of(stage->fit.candidates, *candidate);
  own.p_value = std::min(1.0, own.score.p_value * own.tests);
  details_[index].score = own.score;
  TracedEffect& detail = details_[index].effect;
  detail.p_value = own.p_value;
  compare_without(*stage, detail);
  // What clearly helps to predict stays, however few stretches judge its parameters.
  const bool needed = predicts_clearly_worse(stage->held_out.whitened, now_->held_out.whitened);
  const bool slight = now_->added.size() > 1 && detail.explained < kImperfection;
  const bool shown =
      slight ? own.p_value <= kBeyondDoubt * level_ : own.p_value <= level_ || needed;
  const bool possible = is_possible(*candidate, now_->fit.values[index]);
  // What it does beside the others as they are, or once they have been fitted without it.
  const bool large =
      is_large(*candidate, effect.scan, own.score) ||
      (needed && is_large(*candidate, effect.scan, refitted_score(*stage, *now_, own.columns)));
  if (!possible || !large || !shown || stage->held_out_sum() < now_->held_out_sum()) {
    take_out(index, stage, "with the others in, it earns nothing");
    return true;
  }
  detail.picture = picture_of(*stage, *now_, *candidate, own.columns, now_->fit.values[index]);
  if (own.score.hidden()) {
    // Only the refit speaks for it, and no linear test can compare it with another.
    detail.p_value =
        std::min(1.0, paired_p_value(now_->system.partition(), stage->held_out.whitened,
                                     now_->held_out.whitened) *
                          own.tests);
    return false;
  }
  detail.as_likely = as_likely(*stage, *candidate, own);
  return settle_rivals(index, *stage, own);
}

// Puts another effect in the place of one; for good where the other is clearly likelier.
bool Tracer::swap(std::size_t index, const AddedEffect& other, bool likelier, bool plainer) {
  const EffectId id = now_->added[index].id;
  std::vector<AddedEffect> effects = now_->added;
  effects[index] = other;
  StagePtr swapped = stage_of(std::move(effects));
  if (!swapped->fit.converged) return false;
  // What is plainer and says the same predicts as well, nearly.
  if (plainer ? predicts_clearly_worse(swapped->held_out.whitened, now_->held_out.whitened)
              : swapped->error.value >= now_->error.value) {
    return false;
  }
  if (likelier) removed_.insert(id);
  mark(round_, id, CandidateState::kRemoved, now_->error.value);
  mark(round_, other.id, CandidateState::kAccepted, swapped->error.value);
  now_ = std::move(swapped);
  add_step(round_,
           fmt::format("{} takes the place of {}{}", name_of(other.id), name_of(id),
                       plainer ? ": plainer, and as good" : ", which it makes superfluous"),
           *now_);
  return true;
}

// Whether another effect, fitted in the place of one, clearly predicts worse. Rivals are compared
// in the linear model of a fit that has bent itself to do without either.
bool Tracer::is_ruled_out(std::size_t index, const AddedEffect& rival) {
  std::vector<AddedEffect> effects = now_->added;
  effects[index] = rival;
  const StagePtr refitted = stage_of(std::move(effects));
  return refitted->fit.converged &&
         predicts_clearly_worse(refitted->held_out.whitened, now_->held_out.whitened);
}

// Of two effects that are the same to first order (a delay and a low-pass): only their fits differ.
Comparison Tracer::compare_fits(std::size_t index, const AddedEffect& rival) {
  std::vector<AddedEffect> effects = now_->added;
  effects[index] = rival;
  const StagePtr other = stage_of(std::move(effects));
  if (!other->fit.converged) return Comparison::kFirst;
  const auto parameters = static_cast<double>(now_->fit.values[index].size());
  const auto is_worse = [&](const Stage& one, const Stage& beside) {
    return predicts_clearly_worse(one.held_out.whitened, beside.held_out.whitened) ||
           lost_p_value(one, beside, parameters) <= level_;
  };
  if (is_worse(*other, *now_)) return Comparison::kFirst;
  return is_worse(*now_, *other) ? Comparison::kSecond : Comparison::kInterchangeable;
}

bool Tracer::settle_rivals(std::size_t index, const Stage& without, const TestedMember& own) {
  const AddedEffect effect = now_->added[index];
  std::vector<TestedMember> rivals;
  const double least_gain = kRivalShare * own.score.gain;
  for (TestedMember& member : test_family(without.system, without.fit.candidates, least_gain)) {
    const Candidate& candidate = without.fit.candidates[member.index];
    const bool in_model = std::ranges::any_of(
        now_->added, [&](const AddedEffect& added) { return added.id == candidate.id; });
    if (in_model || member.p_value > level_ || !may_be_added(candidate, member.scan, member.score))
      continue;
    // What it says beyond the effect, the forward search would have found.
    if (refines(candidate, effect.id) || contains(candidate, effect.id)) continue;
    if (member.score.gain < least_gain) continue;
    rivals.push_back(std::move(member));
  }
  std::ranges::stable_sort(rivals, std::greater{},
                           [](const TestedMember& rival) { return rival.score.gain; });
  if (rivals.size() > kMostRivals) rivals.resize(kMostRivals);
  const double own_freedom = freedom_of(without.fit.candidates[own.index], own.score);
  Ambiguity ambiguity;
  for (const TestedMember& rival : rivals) {
    const Candidate& candidate = without.fit.candidates[rival.index];
    const double freedom = freedom_of(candidate, rival.score);
    const bool same = std::abs(rival.score.gain - own.score.gain) < kSameGain * own.score.gain;
    const Comparison comparison =
        same ? compare_fits(index, {candidate.id, rival.scan})
             : compare_effects(without.system, {own.columns, own_freedom, own.score.statistic},
                               {rival.columns, freedom, rival.score.statistic});
    if (comparison == Comparison::kFirst) continue;
    // Of two that say the same the plainer one comes first.
    const bool plainer = freedom < own_freedom && !needed_.contains(effect.id);
    const bool likelier = comparison == Comparison::kSecond;
    if ((likelier || plainer) && swap(index, {candidate.id, rival.scan}, likelier, plainer))
      return true;
    if (likelier || is_ruled_out(index, {candidate.id, rival.scan})) continue;
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
