// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/trace_calibration.h"

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "calib/effects/coupling_by_design.h"
#include "calib/effects/gravity_by_sag.h"
#include "calib/effects/traced_bundle.h"
#include "calib/trace/family.h"
#include "calib/trace/held_out.h"
#include "calib/trace/tracer.h"

namespace kinescope {
namespace {

/// A sag, and where gravity points if it is one.
struct TellingSag {
  EffectId id;
  effects::GravityBySag gravity;
};

// Sags that may say where gravity points: of those that were named the one that explains most;
// where none was, those that are likely and move most. What one mass in the middle of the links
// does is a poor picture of a large sag, and what lasts as long leaves few stretches to judge it
// by.
std::vector<EffectId> likely_sags(const Trace& trace) {
  const TracedEffect* named = nullptr;
  for (const TracedEffect& accepted : trace.accepted) {
    if (!effects::is_sag(accepted.id)) continue;
    if (named == nullptr || accepted.explained > named->explained) named = &accepted;
  }
  if (named != nullptr) return {named->id};
  if (trace.verdict == TraceVerdict::kNothingToSay) return {};
  std::map<EffectId, double> moves;
  for (const TestedCandidate& tested : trace.candidates) {
    if (!effects::is_sag(tested.id) || tested.p_value > trace::kHint) continue;
    double& most = moves[tested.id];
    most = std::max(most, tested.moves);
  }
  std::vector<EffectId> out;
  for (const auto& [id, most] : moves) out.push_back(id);
  std::ranges::stable_sort(out, std::greater{}, [&](const EffectId& id) { return moves.at(id); });
  out.resize(std::min(out.size(), trace::kMostHints));
  return out;
}

// What else was found at this joint may have stood for what one mass does not say of the sag.
std::vector<AddedEffect> elsewhere(std::vector<AddedEffect> known, const EffectId& sag) {
  std::erase_if(known, [&](const AddedEffect& effect) { return effect.id.place == sag.place; });
  return known;
}

// Under the gravity that each would have, the one that explains most.
std::optional<TellingSag> telling_sag(const EffectBundle& bundle,
                                      const CalibrationTraceOptions& options,
                                      const std::vector<AddedEffect>& known, const Trace& trace) {
  std::optional<TellingSag> out;
  for (const EffectId& id : likely_sags(trace)) {
    const effects::TracedBundle model(bundle, options);
    TellingSag told{id, effects::gravity_by_sag(model, elsewhere(known, id), id)};
    if (!out || told.gravity.explained > out->gravity.explained) out = std::move(told);
  }
  return out;
}

bool names(const Trace& trace, const EffectId& id) {
  return std::ranges::find(trace.accepted, id, &TracedEffect::id) != trace.accepted.end();
}

// One cause that leaves nothing: with gravity known, no sag is plainer or clearly better.
bool is_told_by_one_other(const Trace& trace) {
  return trace.verdict == TraceVerdict::kEffects && trace.accepted.size() == 1 &&
         !effects::is_sag(trace.accepted.front().id);
}

void take_corrections(const effects::TracedBundle& model, const CalibrationTraceOptions& options,
                      CalibrationTrace& out) {
  effects::TracedBundle::Corrected corrected = model.corrected(out.trace.added, out.trace.accepted);
  out.effects = std::move(corrected.effects);
  out.corrections = std::move(corrected.corrections);
  out.gravity_base = corrected.gravity_base ? corrected.gravity_base : options.gravity_base;
}

// `model`: of this bundle with these options.
CalibrationTrace traced(const effects::TracedBundle& model, const EffectBundle& bundle,
                        const CalibrationTraceOptions& options, const TraceOptions& trace_options,
                        const Progress& progress) {
  CalibrationTrace out;
  out.trace = trace_effects(model, trace_options, progress);
  effects::add_couplings_by_design(bundle, options, trace_options, out.trace);
  take_corrections(model, options, out);
  out.stamp_jitter_s = bundle.stamp_jitter_s();
  return out;
}

// The effects of the bundle under the gravity that a sag would have, with that sag and what is
// known elsewhere to begin with; `may_go`: an answer without the sag is one.
CalibrationTrace traced_upright(const EffectBundle& bundle, CalibrationTraceOptions options,
                                TraceOptions trace_options, const TellingSag& told_by,
                                std::vector<AddedEffect> known, bool may_go,
                                const Progress& progress) {
  options.gravity_base = told_by.gravity.direction;
  trace_options.start = elsewhere(std::move(known), told_by.id);
  trace_options.start.push_back({told_by.id, 0.0});
  if (!may_go) trace_options.about = told_by.id;
  CalibrationTrace out =
      traced(effects::TracedBundle(bundle, options), bundle, options, trace_options, progress);
  // Without couplings by design stands before it.
  const auto as_it_is = std::ranges::find(out.trace.steps, trace::kModelAsItIs, &TraceStep::words);
  if (as_it_is == out.trace.steps.end()) return out;
  as_it_is->words = fmt::format("{}; gravity points where the sag of {} says", trace::kModelAsItIs,
                                told_by.id.place);
  return out;
}

// The answer under the gravity that the first of these sags would have, where that leaves nothing.
// Where others stand in for something else, so do further sags.
std::optional<CalibrationTrace> explained_upright(const EffectBundle& bundle,
                                                  const CalibrationTraceOptions& options,
                                                  const TraceOptions& trace_options,
                                                  const std::vector<AddedEffect>& added,
                                                  const EffectId& sag, const Progress& progress) {
  const effects::TracedBundle model(bundle, options);
  const TellingSag told{sag, effects::gravity_by_sag(model, elsewhere(added, sag), sag)};
  CalibrationTrace out =
      traced_upright(bundle, options, trace_options, told, added, false, progress);
  if (out.trace.verdict != TraceVerdict::kEffects || !names(out.trace, sag)) return std::nullopt;
  return out;
}

CalibrationTrace traced_with_gravity(const EffectBundle& bundle,
                                     const CalibrationTraceOptions& options,
                                     const Progress& progress) {
  TraceOptions trace_options = options.trace;
  const effects::TracedBundle model(bundle, options);
  trace_options.start = model.possible(options.trace.start);
  if (bundle.kind() == MeasurementKind::kCorners) {
    // An effect that moves corners by less is not told from the detector's own errors.
    trace_options.floor = std::max(trace_options.floor, bundle.corner_bias_px());
  }
  if (options.calibrate.estimate_time_offset && !bundle.postures()) {
    trace_options.start.push_back({{"time_offset", "clock"}, 0.0});
  }
  if (options.gravity_base) return traced(model, bundle, options, trace_options, progress);
  // A sag without gravity is a poor picture of what it does, for which others stand in: gravity is
  // asked for as soon as a sag was added, and where that leaves nothing, these are not looked for.
  bool is_asked = false;
  std::optional<CalibrationTrace> upright;
  TraceOptions until = trace_options;
  until.until = [&](const std::vector<AddedEffect>& added) {
    const auto sag = std::ranges::find_if(
        added, [](const AddedEffect& effect) { return effects::is_sag(effect.id); });
    if (is_asked || sag == added.end()) return false;
    is_asked = true;
    upright = explained_upright(bundle, options, trace_options, added, sag->id, progress);
    return upright.has_value();
  };
  CalibrationTrace out = traced(model, bundle, options, until, progress);
  if (upright) return *std::move(upright);
  if (is_told_by_one_other(out.trace)) return out;
  // Where gravity is known, every link's mass is a load of its own: once more, and kept where that
  // predicts better and needs no more effects, or leaves nothing that no effect explains.
  std::vector<AddedEffect> known = trace_options.start;
  for (const AddedEffect& added : out.trace.added) {
    if (std::ranges::find(known, added.id, &AddedEffect::id) == known.end()) known.push_back(added);
  }
  const std::optional<TellingSag> told_by = telling_sag(bundle, options, known, out.trace);
  if (!told_by) return out;
  const EffectId& sag = told_by->id;
  CalibrationTrace again = traced_upright(bundle, options, trace_options, *told_by, known,
                                          names(out.trace, sag), progress);
  const bool says_all =
      out.trace.verdict == TraceVerdict::kUnknown && again.trace.verdict != TraceVerdict::kUnknown;
  // What predicts clearly better may need more.
  const HeldOutError& before = out.trace.held_out_after;
  const bool needs_more =
      again.trace.accepted.size() > std::max<std::size_t>(1, out.trace.accepted.size()) &&
      again.trace.held_out_after.value >= before.interval.low;
  // What needs fewer and leaves nothing is plainer, and stays unless it predicts clearly worse.
  const bool plainer = again.trace.verdict == TraceVerdict::kEffects &&
                       again.trace.accepted.size() < out.trace.accepted.size() &&
                       !trace::predicts_clearly_worse(again.trace, out.trace);
  // What was only likely is told by gravity, or gravity by nothing.
  const bool told = names(out.trace, sag) || names(again.trace, sag);
  // Other effects say it, too, and give way to what predicts clearly better.
  const bool others_say = out.trace.verdict == TraceVerdict::kEffects && !names(out.trace, sag);
  const double bar = others_say ? before.interval.low : before.value;
  const bool better = again.trace.held_out_after.value < bar && !(needs_more && !says_all);
  if (again.trace.verdict == TraceVerdict::kNothingToSay || !told || !(better || plainer)) {
    return out;
  }
  return again;
}

// Corrections beside which sightings are chosen, on readings without steps and noise.
std::vector<Correction> without_readings(const CalibrationTrace& found) {
  std::vector<Correction> out;
  auto next = found.corrections.begin();
  for (const FittedEffect& effect : found.effects) {
    if (effects::is_clock_offset(effect.id)) continue;
    const auto end = next + effect.values.size();
    if (!effects::is_of_reading(effect.id)) out.insert(out.end(), next, end);
    next = end;
  }
  out.insert(out.end(), next, found.corrections.end());
  return out;
}

// Without the effects, what they do passed for noise: of postures those stood out whose noise adds
// to it, of films it is what changes from one frame to the next.
bool judges_better(const EffectBundle& beside, const EffectBundle& without) {
  // 4 to 6 beside effects of 1 to 2 degrees that a fit without them bends (5128, 5178); 1.0 to 1.1
  // where a second search says the same (9032, 9047).
  constexpr double kFiner = 1.5;
  return beside.postures() ? !beside.chose_as(without) : beside.finer_than(without) > kFiner;
}

// Where those stood out whose noise adds to the effects, the others make them smaller than they
// are.
void size_again(const EffectBundle& chosen, const CalibrationTraceOptions& options,
                CalibrationTrace& out) {
  const effects::TracedBundle model(chosen, options);
  if (model.possible(out.trace.added) != out.trace.added) return;
  effects::shift_ratios_by_design(chosen, -1.0, out.trace);
  kinescope::size_again(model, out.trace);
  effects::shift_ratios_by_design(chosen, 1.0, out.trace);
  take_corrections(model, options, out);
}

// True where some instant is another one than the sightings that were used say.
bool move_to_likeliest_instants(const EffectBundle& bundle, const CalibrationTraceOptions& options,
                                CalibrationTrace& out) {
  const effects::TracedBundle model(bundle, options);
  if (model.possible(out.trace.added) != out.trace.added) return false;
  const std::vector<AddedEffect> moved = model.at_likeliest_instants(out.trace.added);
  if (moved == out.trace.added) return false;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const AddedEffect& before = out.trace.added[i];
    for (TracedEffect& accepted : out.trace.accepted) {
      if (accepted.id == before.id && accepted.scan == before.scan) accepted.scan = moved[i].scan;
    }
  }
  out.trace.added = moved;
  take_corrections(model, options, out);
  return true;
}

}  // namespace

CalibrationTrace trace_calibration(const Measurements& measurements, const MarkerSet& markers,
                                   const JointLog& log, const CalibrationStart& start,
                                   const CalibrationTraceOptions& options,
                                   const Progress& progress) {
  const EffectBundle bundle(measurements, markers, log, start, options.calibrate);
  CalibrationTrace out = traced_with_gravity(bundle, options, progress);
  if (out.corrections.empty()) return out;
  CalibrationTraceOptions begun = options;
  begun.gravity_base = out.gravity_base;
  const bool moved = move_to_likeliest_instants(bundle, begun, out);
  CalibrationStart known = start;
  known.corrections = without_readings(out);
  const EffectBundle chosen(measurements, markers, log, known, options.calibrate);
  if (!judges_better(chosen, bundle)) {
    if (moved || !chosen.chose_as(bundle)) size_again(chosen, begun, out);
    return out;
  }
  begun.trace.start = out.trace.added;
  CalibrationTrace again = traced_with_gravity(chosen, begun, progress);
  again.trace.steps.front().words = out.trace.steps.front().words;
  return again;
}

}  // namespace kinescope
