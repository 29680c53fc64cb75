// SPDX-License-Identifier: Apache-2.0
#include "app/explain/compare_explanations.h"

#include <algorithm>
#include <cmath>

#include "calib/quality/predictive_score.h"
#include "calib/quality/unknown_axes.h"

namespace kinescope {
namespace {

bool has_model_doubt(const Structure& structure) {
  return std::ranges::any_of(structure.doubts, &StructureDoubt::of_model);
}

/// No axis is known of a joint too many that nothing but noise drives (`undeclared`, 11083).
bool are_axes_known(const Explanation& of) {
  return !of.fitted || unknown_axes(of.fitted->calibration).empty();
}

/// By its scale, which then says nothing of a joint that channel drives.
bool has_joint_at_rest(const Calibration& of) {
  for (std::size_t j = 0; j < of.joints.size(); ++j) {
    const auto sigma = of.joints[j].scale_sigma;
    if (!sigma || of.tree.joints[j].channel.empty()) continue;
    const double z = of.tree.joints[j].scale / *sigma;
    if (0.5 * z * z < StructureOptions{}.min_log_odds) return true;
  }
  return false;
}

bool is_all_explained(const Trace& trace) {
  return trace.verdict != TraceVerdict::kUnknown && trace.verdict != TraceVerdict::kNothingToSay;
}

/// What it takes for an account: joints, the motion of those that no channel tells, and effects.
std::size_t parts_of(const Explanation& of) {
  const auto told_by_none = static_cast<std::size_t>(
      std::ranges::count(of.start.tree.joints, std::string(), &Joint::channel));
  return of.start.tree.joints.size() + told_by_none + of.fitted->trace.accepted.size();
}

}  // namespace

bool is_converged(const Calibration& of) { return of.status == CalibrationStatus::kConverged; }

bool is_structure_clear(const Explanation& of) {
  return !of.structure || (of.structure->status == StructureStatus::kDetermined &&
                           !has_model_doubt(*of.structure) && are_axes_known(of));
}

bool is_structure_sound(const Explanation& of) {
  return is_structure_clear(of) && (!of.fitted || is_converged(of.fitted->calibration));
}

bool is_explained(const Explanation& of) {
  return of.fitted && is_converged(of.fitted->calibration) &&
         (of.fitted->trace.verdict == TraceVerdict::kNotRun || is_all_explained(of.fitted->trace));
}

bool is_bent(const TracedCalibration& fitted) {
  constexpr double kBent = 3.0;  // times the noise
  return !fitted.effects.empty() &&
         fitted.trace.held_out_before.value > kBent * fitted.trace.held_out_after.value;
}

bool is_settled(const Explanation& of) { return is_explained(of) && is_structure_clear(of); }

bool is_better(const Explanation& one, const Explanation& other, const Measurements& measurements) {
  if (!one.fitted || !other.fitted) return one.fitted.has_value();
  const double clearly = StructureOptions{}.min_log_odds;
  const double odds = log_odds(predictive_score(one.fitted->calibration, measurements),
                               predictive_score(other.fitted->calibration, measurements));
  if (std::abs(odds) > clearly) return odds > 0.0;
  if (is_settled(one) != is_settled(other)) return is_settled(one);
  return parts_of(one) < parts_of(other);
}

double log_odds_of(const Explanation& one, const Explanation& rival,
                   const Measurements& measurements) {
  constexpr double kMost = 1000.0;  // larger ones mean nothing: the models are not that right
  if (!rival.fitted || !is_converged(rival.fitted->calibration) || !are_axes_known(rival) ||
      has_joint_at_rest(rival.fitted->calibration))
    return kMost;
  return std::clamp(log_odds(predictive_score(one.fitted->calibration, measurements),
                             predictive_score(rival.fitted->calibration, measurements)),
                    -kMost, kMost);
}

std::vector<int> folds_of(const Calibration& calibration) {
  if (calibration.folds < 2) return {};
  std::vector<int> out(calibration.times_s.size(), -1);
  for (const SightingResidual& residual : calibration.residuals)
    out[static_cast<std::size_t>(residual.frame)] = residual.fold;
  // A frame that it could not use goes with the one before.
  const auto known = std::ranges::find_if(out, [](int fold) { return fold >= 0; });
  int last = known == out.end() ? 0 : *known;
  for (int& fold : out) {
    if (fold < 0) fold = last;
    last = fold;
  }
  return out;
}

}  // namespace kinescope
