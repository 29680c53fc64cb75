// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/trace_calibration.h"

#include <algorithm>

#include <fmt/format.h>

#include "calib/effects/coupling_by_design.h"
#include "calib/effects/gravity_by_sag.h"
#include "calib/effects/traced_bundle.h"

namespace kinescope {
namespace {

// The joint whose sag explains most.
const TracedEffect* largest_sag(const Trace& trace) {
  const TracedEffect* out = nullptr;
  for (const TracedEffect& accepted : trace.accepted) {
    if (accepted.id.effect != "compliance") continue;
    if (out == nullptr || accepted.explained > out->explained) out = &accepted;
  }
  return out;
}

CalibrationTrace traced(const EffectBundle& bundle, const CalibrationTraceOptions& options,
                        const TraceOptions& trace_options, const Progress& progress) {
  const effects::TracedBundle model(bundle, options);
  CalibrationTrace out;
  out.trace = trace_effects(model, trace_options, progress);
  effects::add_couplings_by_design(bundle, options, out.trace);
  effects::TracedBundle::Corrected corrected = model.corrected(out.trace.added, out.trace.accepted);
  out.effects = std::move(corrected.effects);
  out.corrections = std::move(corrected.corrections);
  out.gravity_base = options.gravity_base;
  out.stamp_jitter_s = bundle.stamp_jitter_s();
  return out;
}

}  // namespace

CalibrationTrace trace_calibration(const Measurements& measurements, const MarkerSet& markers,
                                   const JointLog& log, const CalibrationStart& start,
                                   const CalibrationTraceOptions& options,
                                   const Progress& progress) {
  const EffectBundle bundle(measurements, markers, log, start, options.calibrate);
  TraceOptions trace_options = options.trace;
  if (bundle.kind() == MeasurementKind::kCorners) {
    // An effect that moves corners by less is not told from the detector's own errors.
    trace_options.floor = std::max(trace_options.floor, bundle.corner_bias_px());
  }
  if (options.calibrate.estimate_time_offset && !bundle.postures()) {
    trace_options.start.push_back({{"time_offset", "clock"}, 0.0});
  }
  CalibrationTrace out = traced(bundle, options, trace_options, progress);
  if (options.gravity_base) return out;
  // Where gravity is known, every link's mass is a load of its own: once more, and kept where that
  // predicts better and needs no more effects.
  const TracedEffect* sag = largest_sag(out.trace);
  if (sag == nullptr) return out;
  CalibrationTraceOptions upright = options;
  upright.gravity_base =
      effects::gravity_by_sag(effects::TracedBundle(bundle, options), trace_options.start, sag->id);
  trace_options.start.push_back({sag->id, 0.0});
  CalibrationTrace again = traced(bundle, upright, trace_options, progress);
  if (again.trace.verdict == TraceVerdict::kNothingToSay ||
      again.trace.accepted.size() > out.trace.accepted.size() ||
      again.trace.held_out_after.value >= out.trace.held_out_after.value) {
    return out;
  }
  again.trace.steps.front().words =
      fmt::format("the model as it is; gravity points where the sag of {} says", sag->id.place);
  return again;
}

}  // namespace kinescope
