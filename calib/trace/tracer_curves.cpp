// SPDX-License-Identifier: Apache-2.0
//
// What is left, repeats, and has no name: curves that become part of the model.
#include <algorithm>
#include <ranges>

#include <fmt/format.h>

#include "calib/trace/curve.h"
#include "calib/trace/picture.h"
#include "calib/trace/tracer.h"

namespace kinescope::trace {
namespace {

constexpr int kTunings = 3;

// What an effect makes of the one carrier that it acts through, about its mean; nothing where there
// are several.
std::optional<Eigen::VectorXd> course_of(const Candidate& candidate, double scan,
                                         const Eigen::VectorXd& theta) {
  const std::vector<EffectColumn> columns = candidate.columns(scan);
  Eigen::VectorXd course = Eigen::VectorXd::Zero(columns.front().share.size());
  for (std::size_t k = 0; k < columns.size(); ++k) {
    if (columns[k].carrier != columns.front().carrier || columns[k].share.size() != course.size())
      return std::nullopt;
    course += theta[static_cast<Eigen::Index>(k)] * columns[k].share;
  }
  if (course.size() > 0) course.array() -= course.mean();
  return course;
}

// True of effects that are less together than each of them is.
bool cancel(const Stage& stage, const std::vector<std::size_t>& members) {
  std::vector<Eigen::VectorXd> courses;
  for (const std::size_t i : members) {
    const Candidate* candidate = find_candidate(stage.fit, stage.added[i].id);
    if (candidate == nullptr) return false;
    auto course = course_of(*candidate, stage.added[i].scan, stage.fit.values[i]);
    if (!course || (!courses.empty() && course->size() != courses.front().size())) return false;
    courses.push_back(std::move(*course));
  }
  Eigen::VectorXd together = Eigen::VectorXd::Zero(courses.front().size());
  for (const Eigen::VectorXd& course : courses) together += course;
  return std::ranges::all_of(courses, [&](const Eigen::VectorXd& course) {
    return together.squaredNorm() < course.squaredNorm();
  });
}

// Of the stage's effects, those that are special cases of a curve.
std::vector<std::size_t> special_cases(const Stage& stage, const Candidate& curve) {
  std::vector<std::size_t> members;
  for (std::size_t i = 0; i < stage.added.size(); ++i)
    if (contains(curve, stage.added[i].id)) members.push_back(i);
  return members;
}

}  // namespace

// The curves that stand for what was found to be left.
std::vector<AddedEffect> Tracer::curves_for_rests() const {
  std::vector<AddedEffect> out;
  for (const FoundRest& found : rests_) {
    const auto candidate = std::ranges::find_if(now_->fit.candidates, [&](const Candidate& c) {
      return c.is_curve() && c.id.place == found.rest.place && c.curve_over == found.rest.covariate;
    });
    if (candidate == now_->fit.candidates.end() || removed_.contains(candidate->id) ||
        is_added(candidate->id)) {
      continue;
    }
    if (const auto curve = likeliest_curve(now_->system, *candidate)) out.push_back(*curve);
  }
  return out;
}

void Tracer::tune_curves() {
  for (int i = 0; i < kTunings; ++i) {
    std::vector<AddedEffect> tuned = tuned_curves(*now_);
    if (tuned == now_->added) return;
    StagePtr stage = stage_of(std::move(tuned));
    if (!stage->fit.converged || stage->held_out_sum() >= now_->held_out_sum()) return;
    now_ = std::move(stage);
  }
}

// What repeats is worth having, named or not: true where something left became part of the model.
bool Tracer::take_the_rest_as_curves() {
  std::vector<AddedEffect> effects = now_->added;
  for (AddedEffect& curve : curves_for_rests()) effects.push_back(std::move(curve));
  if (effects.size() == now_->added.size()) return false;
  StagePtr stage = stage_of(std::move(effects));
  if (!stage->fit.converged ||
      !predicts_clearly_worse(now_->held_out.whitened, stage->held_out.whitened)) {
    return false;
  }
  now_ = std::move(stage);
  tune_curves();
  for (std::size_t i = details_.size(); i < now_->added.size(); ++i) {
    add_step(round_, fmt::format("{} taken as it is", name_of(now_->added[i].id)), *now_);
  }
  details_.resize(now_->added.size());
  drop_what_curves_contain();
  return true;
}

// A wave that a curve at its place can do without is part of that curve; so is one whose name the
// curve puts in doubt.
bool Tracer::is_part_of_a_curve(std::size_t wave, std::size_t curve, const Stage& without) {
  if (!without.fit.converged) return false;
  if (!predicts_clearly_worse(without.held_out.whitened, now_->held_out.whitened)) return true;
  const StagePtr only_wave = stage_of(kinescope::trace::without(now_->added, curve));
  if (only_wave->system.total().rr - now_->system.total().rr <
      kDoubtfulShare * details_[wave].effect.explained * base_->system.total().rr) {
    return false;
  }
  const StagePtr neither = stage_of(kinescope::trace::without(
      kinescope::trace::without(now_->added, std::max(wave, curve)), std::min(wave, curve)));
  return without.held_out_sum() - now_->held_out_sum() <
         kSmallLoss * (neither->held_out_sum() - now_->held_out_sum());
}

void Tracer::drop_what_curves_contain() {
  for (std::size_t i = now_->added.size(); i-- > 0;) {
    const EffectId id = now_->added[i].id;
    const auto curve = std::ranges::find_if(now_->added, [&](const AddedEffect& other) {
      const Candidate* candidate = find_candidate(now_->fit, other.id);
      return candidate != nullptr && candidate->is_curve() && contains(*candidate, id);
    });
    if (curve == now_->added.end()) continue;
    StagePtr stage = stage_of(kinescope::trace::without(now_->added, i));
    std::vector<AddedEffect> tuned = tuned_curves(*stage);
    if (tuned != stage->added) stage = stage_of(std::move(tuned));
    if (!is_part_of_a_curve(i, static_cast<std::size_t>(curve - now_->added.begin()), *stage)) {
      continue;
    }
    take_out(i, std::move(stage), "it is part of a curve");
    tune_curves();
  }
}

// Large effects that cancel are a small one of another shape: over a part of a turn a straight line
// and a sine are whatever a sensor's curve is (a cubic of 0.6 deg: 7.5 deg and 13 %).
void Tracer::take_a_curve_for_what_cancels() {
  const StagePtr before = now_;
  for (const Candidate& curve : before->fit.candidates) {
    if (!curve.is_curve() || removed_.contains(curve.id)) continue;
    const std::vector<std::size_t> members = special_cases(*now_, curve);
    if (members.size() < 2 || !cancel(*now_, members)) continue;
    std::vector<AddedEffect> effects = now_->added;
    for (const std::size_t i : members | std::views::reverse)
      effects = kinescope::trace::without(std::move(effects), i);
    const StagePtr none = stage_of(effects);
    const auto likeliest = likeliest_curve(none->system, curve);
    if (!likeliest) continue;
    effects.push_back(*likeliest);
    StagePtr stage = stage_of(std::move(effects));
    if (!stage->fit.converged) continue;
    const double lost = stage->held_out_sum() - now_->held_out_sum();
    if (lost > kSmallLoss * (none->held_out_sum() - now_->held_out_sum()) &&
        predicts_clearly_worse(stage->held_out.whitened, now_->held_out.whitened))
      continue;
    for (const std::size_t i : members | std::views::reverse) {
      removed_.insert(now_->added[i].id);
      mark(round_, now_->added[i].id, CandidateState::kRemoved, none->error.value);
      details_.erase(details_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    now_ = std::move(stage);
    tune_curves();
    details_.resize(now_->added.size());
    add_step(round_, fmt::format("{} takes the place of effects that cancel", name_of(curve.id)),
             *now_);
  }
}

void Tracer::look_beside_curves() {
  rests_.clear();
  while (std::optional<FoundRest> found = next_rest()) add_rest(std::move(*found));
}

void Tracer::describe_curves() {
  for (std::size_t i = 0; i < now_->added.size(); ++i) {
    const AddedEffect& added = now_->added[i];
    const Candidate* candidate = find_candidate(now_->fit, added.id);
    if (candidate == nullptr || !candidate->is_curve()) continue;
    const StagePtr stage = stage_of(kinescope::trace::without(now_->added, i));
    TracedEffect& detail = details_[i].effect;
    detail.p_value =
        paired_p_value(now_->system.partition(), stage->held_out.whitened, now_->held_out.whitened);
    compare_without(*stage, detail);
    detail.picture =
        picture_of(*stage, *now_, *candidate, candidate->columns(added.scan), now_->fit.values[i]);
  }
}

}  // namespace kinescope::trace
