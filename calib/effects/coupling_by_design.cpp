// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/coupling_by_design.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "calib/effects/traced_bundle.h"
#include "calib/trace/distribution.h"
#include "calib/trace/score_test.h"
#include "calib/trace/stage.h"
#include "calib/trace/tracer.h"
#include "kinematics/core/error.h"

namespace kinescope::effects {
namespace {

using trace::make_stage;
using trace::Stage;
using trace::StagePtr;

constexpr double kTail = 0.025;  // of an interval of 95 %

AddedEffect effect_of(const EffectBundle& bundle, const DesignCoupling& coupling) {
  return {{"coupling", bundle.tree().joints[static_cast<std::size_t>(coupling.joint)].name},
          static_cast<double>(coupling.other)};
}

// What the first parameter of an added effect is, and how far it is known.
struct Estimate {
  double value = 0.0;
  double sigma = 0.0;
};

Estimate estimate_of(const Stage& stage, std::size_t index) {
  Eigen::Index count = 0;
  Eigen::Index at = 0;
  for (std::size_t i = 0; i < stage.fit.values.size(); ++i) {
    if (i == index) at = count;
    count += stage.fit.values[i].size();
  }
  const Eigen::MatrixXd covariance = trace::jackknife_covariance(stage.system, count);
  return {stage.fit.values[index][0], std::sqrt(std::max(0.0, covariance(at, at)))};
}

struct Described {
  TracedEffect effect;  ///< `explained` in whitened squares
  double left = 0.0;    ///< squares with it
};

Described described(const EffectBundle& bundle, const CalibrationTraceOptions& options,
                    const std::vector<AddedEffect>& added, std::size_t coupling) {
  const DesignCoupling& design = bundle.couplings()[coupling];
  const AddedEffect effect = effect_of(bundle, design);
  // The ratio itself is held: what the recording says beyond it is an effect beside the others.
  std::vector<AddedEffect> with = added;
  auto own = std::ranges::find(with, effect);
  if (own == with.end()) own = with.insert(with.end(), effect);
  const auto index = static_cast<std::size_t>(own - with.begin());
  std::vector<AddedEffect> others = with;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(index));

  const StagePtr now = make_stage(TracedBundle(bundle, options), with);
  const StagePtr before = make_stage(TracedBundle(bundle, options, {coupling}), others);
  const Candidate* candidate = trace::find_candidate(now->fit, effect.id);
  KINESCOPE_CHECK(candidate != nullptr, "joints that a channel drives may be coupled");
  const Estimate beyond = estimate_of(*now, index);
  const double freedom = std::max(2.0, now->system.partition().stretches - 1.0);
  const double half = trace::t_quantile(kTail, freedom) * beyond.sigma;

  TracedEffect out;
  out.id = effect.id;
  out.words = candidate->words;
  out.check = candidate->check;
  out.size = design.ratio + beyond.value;
  out.unit = candidate->size_unit;
  out.interval = {out.size - half, out.size + half};
  out.values = {{candidate->parameters.front(), out.size, beyond.sigma}};
  out.scan = effect.scan;
  out.scan_name = candidate->scan_name;
  out.scan_words = candidate->scan_words(effect.scan);
  out.p_value = beyond.sigma > 0.0
                    ? trace::f_survival(std::pow(out.size / beyond.sigma, 2), 1.0, freedom)
                    : 0;
  out.held_out_before = before->error;
  out.held_out_after = now->error;
  out.explained = before->system.total().rr - now->system.total().rr;
  return {std::move(out), now->system.total().rr};
}

// The joint follows the other one along a curve: the ratio is its slope and no cause of its own.
bool is_slope_of_a_rest(const Described& coupling, const Trace& trace) {
  return std::ranges::any_of(trace.rest, [&](const Rest& rest) {
    return rest.place == coupling.effect.id.place &&
           rest.covariate == "value of " + coupling.effect.scan_words &&
           rest.explained * coupling.left >= trace::kDoubtfulShare * coupling.effect.explained;
  });
}

// What lasts beside it is no noise, and no less than a part of what it stands for.
bool leaves_too_much(const Described& coupling, const Trace& trace) {
  const bool curves = std::ranges::any_of(
      trace.accepted, [](const TracedEffect& known) { return known.is_curve(); });
  return trace.verdict == TraceVerdict::kUnknown && trace.rest.empty() && !curves &&
         coupling.left >= trace::kDoubtfulShare * coupling.effect.explained;
}

// All of them are found one after the other by a search that knows none.
bool come_first(const EffectBundle& bundle, const TracedBundle& without, TraceOptions options) {
  std::erase_if(options.start,
                [](const AddedEffect& effect) { return !is_clock_offset(effect.id); });
  std::vector<AddedEffect> missing;
  for (const DesignCoupling& coupling : bundle.couplings())
    missing.push_back(effect_of(bundle, coupling));
  while (!missing.empty()) {
    const std::optional<AddedEffect> first = first_effect(without, options);
    if (!first || std::erase(missing, *first) == 0) return false;
    options.start.push_back(*first);
  }
  return true;
}

}  // namespace

void add_couplings_by_design(const EffectBundle& bundle, const CalibrationTraceOptions& options,
                             const TraceOptions& trace_options, Trace& trace) {
  if (trace.verdict == TraceVerdict::kNothingToSay || bundle.couplings().empty()) return;
  std::vector<std::size_t> all(bundle.couplings().size());
  for (std::size_t k = 0; k < all.size(); ++k) all[k] = k;
  const TracedBundle without(bundle, options, all);
  const StagePtr plain = make_stage(without, {});
  trace.design_comes_first = come_first(bundle, without, trace_options);
  std::vector<TracedEffect> found;
  std::string names;
  for (const std::size_t k : all) {
    const Described coupling = described(bundle, options, trace.added, k);
    if (is_slope_of_a_rest(coupling, trace) || leaves_too_much(coupling, trace)) continue;
    TracedEffect effect = coupling.effect;
    // A ratio that the structure took for likely may be nothing.
    if (effect.p_value > trace.false_alarm_rate ||
        effect.held_out_before.value <= effect.held_out_after.value) {
      continue;
    }
    effect.explained = std::clamp(effect.explained / plain->system.total().rr, 0.0, 1.0);
    names += (names.empty() ? "" : ", ") + trace::name_of(effect.id);
    // What the search found beyond the ratio is a part of it.
    std::erase_if(trace.accepted, [&](const TracedEffect& known) {
      return known.id == effect.id && known.scan == effect.scan;
    });
    std::erase_if(trace.not_found,
                  [&](const NotFoundEffect& missing) { return missing.id == effect.id; });
    found.push_back(std::move(effect));
  }
  if (found.empty()) return;
  trace.accepted.insert(trace.accepted.begin(), found.begin(), found.end());
  trace.held_out_before = plain->error;
  trace.steps.insert(trace.steps.begin(),
                     {0, fmt::format("without {}", names), plain->rms(), plain->error});
  if (trace.verdict == TraceVerdict::kClean) trace.verdict = TraceVerdict::kEffects;
  if (trace.verdict == TraceVerdict::kEffects)
    trace.reason = trace::found_words(trace.found, trace.accepted);
}

void shift_ratios_by_design(const EffectBundle& bundle, double times, Trace& trace) {
  for (const DesignCoupling& coupling : bundle.couplings()) {
    const AddedEffect own = effect_of(bundle, coupling);
    if (std::ranges::find(trace.added, own) == trace.added.end()) continue;
    for (TracedEffect& known : trace.accepted) {
      if (known.id != own.id || known.scan != own.scan) continue;
      const double more = times * coupling.ratio;
      known.size += more;
      known.interval.low += more;
      known.interval.high += more;
      known.values.front().value += more;
    }
  }
}

}  // namespace kinescope::effects
