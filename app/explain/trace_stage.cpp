// SPDX-License-Identifier: Apache-2.0
#include "app/explain/trace_stage.h"

#include <algorithm>

#include "calib/effects/observed_range.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// The detector's corners are off by this much in ways that repeat with the view (H.264, light,
// small markers). Corners from elsewhere are taken at their word.
constexpr double kDetectorBias = 0.01;  // px

// From where the plain calibration ended; a nominal robot stays the start, since its prior is
// around it.
CalibrationStart continued(const CalibrationStart& start, const Calibration& plain) {
  CalibrationStart out = start;
  for (std::size_t c = 0; c < out.further_cameras.size(); ++c) {
    FurtherCamera& camera = out.further_cameras[c];
    const CameraEstimate& found = plain.further_cameras[c];
    camera.T_camera_base = found.T_camera_base;
    if (start.nominal) continue;
    camera.camera = found.camera;
    camera.lag_s = found.lag_s;
  }
  out.moving = plain.moving;
  if (start.nominal) {
    out.T_camera_base = plain.T_camera_base;
    out.tree.markers = plain.tree.markers;
    return out;
  }
  out.tree = plain.tree;
  out.T_camera_base = plain.T_camera_base;
  out.camera = plain.camera;
  out.time_offset_s = plain.time_offset_s;
  if (!start.joint_values.size()) return out;
  out.joint_values = plain.joint_values;
  return out;
}

// What is exported is fitted once more, without the curves of a rest: its numbers hold together.
void take_values(const Calibration& calibration, const std::vector<Correction>& corrections,
                 std::vector<FittedEffect>& effects) {
  std::vector<double> values;
  for (const Parameter& parameter : calibration.parameters) {
    if (parameter.block == "effects") values.push_back(parameter.value);
  }
  // Those of a few frames each are not among a calibration's parameters.
  KINESCOPE_CHECK(
      std::ssize(values) == std::ranges::count(corrections, false, &Correction::is_local),
      "a value for each correction");
  values.resize(
      static_cast<std::size_t>(std::ranges::count(corrections, false, &Correction::is_nuisance)));
  std::size_t next = 0;
  for (FittedEffect& effect : effects) {
    if (effect.id == EffectId{"time_offset", "clock"}) {
      effect.values[0] = calibration.time_offset_s;
      continue;
    }
    for (double& value : effect.values) value = values.at(next++);
    if (!effect.table.empty()) effect.table.error = effect.table_shares * effect.values;
  }
  KINESCOPE_CHECK(next == values.size(), "a value for each number of the effects");
  for (FittedEffect& effect : effects) effect.range = observed_range(effect, calibration.tree);
}

}  // namespace

TracedCalibration trace_stage(const Recording& recording, const Observed& observed,
                              const CalibrationStart& start, const Calibration& plain,
                              const TraceStart& begin, const CalibrateOptions& options,
                              const Progress& progress) {
  if (start.tree.joints.empty()) {
    TracedCalibration out{{}, plain, {}, {}, 0.0};
    out.trace.verdict = TraceVerdict::kNothingToSay;
    out.trace.reason = "effects are looked for in the motion of joints, and there is none";
    return out;
  }
  CalibrationTraceOptions trace_options;
  trace_options.calibrate = options;
  trace_options.trace.start = begin.known;
  if (recording.entry == RecordingEntry::kVideo) trace_options.trace.floor = kDetectorBias;
  // A declared gravity, and a nominal robot, put the base upright.
  if (recording.settings.gravity || start.nominal) {
    trace_options.gravity_base = -Eigen::Vector3d::UnitZ();
  }
  CalibrationStart from = continued(start, begin.near ? *begin.near : plain);
  // What the camera lacks is among the effects.
  if (begin.near) from.camera = plain.camera;
  const CalibrationTrace found = trace_calibration(observed.measurements, recording.markers,
                                                   recording.log, from, trace_options, progress);
  TracedCalibration out{found.trace, plain, found.effects, found.gravity_base,
                        found.stamp_jitter_s};
  if (!found.corrections.empty()) {
    from.corrections = found.corrections;
    out.calibration =
        calibrate(observed.measurements, recording.markers, recording.log, from, options, progress);
  }
  take_values(out.calibration, from.corrections, out.effects);
  out.corrections = from.corrections;
  return out;
}

}  // namespace kinescope
