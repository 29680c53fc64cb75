// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/trace_calibration.h"

#include <algorithm>

#include "calib/effects/coupling_by_design.h"
#include "calib/effects/traced_bundle.h"

namespace kinescope {
CalibrationTrace trace_calibration(const Measurements& measurements, const MarkerSet& markers,
                                   const JointLog& log, const CalibrationStart& start,
                                   const CalibrationTraceOptions& options,
                                   const Progress& progress) {
  const EffectBundle bundle(measurements, markers, log, start, options.calibrate);
  const effects::TracedBundle model(bundle, options);
  TraceOptions trace_options = options.trace;
  if (bundle.kind() == MeasurementKind::kCorners) {
    // An effect that moves corners by less is not told from the detector's own errors.
    trace_options.floor = std::max(trace_options.floor, bundle.corner_bias_px());
  }
  if (options.calibrate.estimate_time_offset && !bundle.postures()) {
    trace_options.start.push_back({{"time_offset", "clock"}, 0.0});
  }
  CalibrationTrace out;
  out.stamp_jitter_s = bundle.stamp_jitter_s();
  out.trace = trace_effects(model, trace_options, progress);
  effects::add_couplings_by_design(bundle, options, out.trace);
  effects::TracedBundle::Corrected corrected = model.corrected(out.trace.added);
  out.effects = std::move(corrected.effects);
  out.corrections = std::move(corrected.corrections);
  return out;
}

}  // namespace kinescope
