// SPDX-License-Identifier: Apache-2.0
#include "app/explain/hypothesis_fit.h"

#include "app/explain/compare_explanations.h"
#include "app/explain/fit_nominal.h"
#include "app/explain/moving_camera.h"
#include "app/explain/see_cameras.h"
#include "app/explain/see_recordings.h"
#include "calib/bundle/undone.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "calib/tracks/several_cameras.h"

namespace kinescope {
namespace {

// The failure of `out`, where that is what the data cannot determine; else thrown.
void keep_if_undetermined(const Error& error, Explanation& out) {
  if (error.code() != ExitCode::kUndetermined) throw Error(error);
  out.fitted.reset();
  out.failure = error;
}

}  // namespace

Explanation HypothesisFit::plainly_explained() const {
  try {
    return plainly_fitted(believed_structure());
  } catch (const Error& error) {
    Explanation out = begun();
    keep_if_undetermined(error, out);
    return out;
  }
}

std::optional<Explanation> HypothesisFit::carried_over(const Explanation& of) const {
  if (!of.fitted || !of.structure) return std::nullopt;
  // What needs effects here and none there is no better for them.
  if (of.fitted->effects.empty()) return plainly_fitted(*of.structure);
  return of_structure(*of.structure, {of.fitted->trace.added});
}

Structure HypothesisFit::believed_structure() const {
  if (!evidence_.structure) return structure_of(evidence_.tracks);
  return whole_of(as_robot(recording(), *evidence_.structure), evidence_.tracks);
}

Explanation HypothesisFit::begun() const {
  Explanation out;
  out.log = recording().log;
  out.tracks = evidence_.tracks;
  return out;
}

Explanation HypothesisFit::of_nominal(std::vector<std::string>& warnings) const {
  Explanation out = begun();
  CheckedNominal checked = start_from_nominal(recording(), evidence_.observed, evidence_.tracks,
                                              evidence_.camera, warnings);
  lap("structure");
  out.nominal_faults = std::move(checked.faults);
  out.start = std::move(checked.start);
  NominalFit fitted = fit_nominal(
      evidence_.observed.measurements, options_.free,
      [&](FreeGeometry free) {
        Calibration plain = calibrated(out.start, free);
        lap("calibrate");
        return plain;
      },
      [&](FreeGeometry free, const Calibration& plain) {
        return closed_loop(out.start, free, plain, {});
      });
  out.fitted = std::move(fitted.best);
  out.levels = std::move(fitted.levels);
  return out;
}

Explanation HypothesisFit::of_structure(Structure structure, const TraceStart& begin) const {
  return traced(plainly_fitted(std::move(structure)), begin);
}

Explanation HypothesisFit::plainly_fitted(Structure structure) const {
  Explanation out = begun();
  out.structure = std::move(structure);
  try {
    require_determined(*out.structure);
    out.start = start_from_structure(*out.structure, recording(), evidence_.camera);
    add_further_cameras(evidence_.observed, out.start);
    add_moving_camera(recording(), *out.structure, evidence_.tracks, out.start);
    Calibration plain = calibrated(out.start, options_.calibrate.free);
    if (is_converged(plain) && take_usual_units(plain.tree, out.start))
      plain = calibrated(out.start, options_.calibrate.free);
    out.fitted = {{}, std::move(plain), {}, {}, 0.0};
    lap("calibrate");
  } catch (const Error& error) {
    keep_if_undetermined(error, out);
  }
  return out;
}

std::optional<Explanation> HypothesisFit::fitted_with(const Sight& sight) const {
  std::optional<Structure> structure = proposed_structure(
      pose_tracks_from_tags(evidence_.observed.tags, sight.camera, sight.markers));
  if (!structure) return std::nullopt;
  ExplainOptions options = options_;
  options.calibrate.estimate_intrinsics |= sight.is_camera_free;
  Recording other = recording();
  other.markers = sight.markers;
  const Evidence seen{other, evidence_.observed, evidence_.tracks, sight.camera};
  return HypothesisFit(seen, std::move(options)).plainly_fitted(*std::move(structure));
}

Explanation HypothesisFit::traced(Explanation plain, const TraceStart& begin) const {
  if (!plain.fitted) return plain;
  try {
    close_loop(plain, begin);
  } catch (const Error& error) {
    keep_if_undetermined(error, plain);
  }
  return plain;
}

std::optional<Structure> HypothesisFit::proposed_structure(const PoseTracks& tracks,
                                                           std::optional<double> allowance) const {
  try {
    return structure_of(tracks, allowance);
  } catch (const Error&) {
    return std::nullopt;
  }
}

PoseTracks HypothesisFit::undone(const Calibration& calibration) const {
  const TagObservations& tags = evidence_.observed.tags;
  if (tags.observations.empty()) return with_effects_undone(calibration, evidence_.tracks);
  const MarkerSet& markers = recording().markers;
  const TagObservations undone = with_effects_undone(calibration, markers, tags);
  if (!calibration.further_cameras.empty()) return tracks_of_cameras(undone, calibration, markers);
  return pose_tracks_from_tags(undone, calibration.camera, markers);
}

Calibration HypothesisFit::calibrated(const CalibrationStart& start, FreeGeometry free) const {
  CalibrateOptions options = options_.calibrate;
  options.free = free;
  return calibrate(evidence_.observed.measurements, recording().markers, recording().log, start,
                   options, options_.progress);
}

TracedCalibration HypothesisFit::closed_loop(const CalibrationStart& start, FreeGeometry free,
                                             const Calibration& plain,
                                             const TraceStart& begin) const {
  if (!options_.trace) return {{}, plain, {}, {}, 0.0};
  if (options_.free && free != FreeGeometry::kGeometry) {
    TracedCalibration out{{}, plain, {}, {}, 0.0};
    out.trace.verdict = TraceVerdict::kNothingToSay;
    out.trace.reason =
        "the robot's geometry is held as declared, and its errors cannot be told from effects: "
        "trace with --free geometry";
    return out;
  }
  CalibrateOptions options = options_.calibrate;
  options.free = free;
  TracedCalibration out =
      trace_stage(recording(), evidence_.observed, start, plain, begin, options, options_.progress);
  lap("trace");
  return out;
}

Structure HypothesisFit::structure_of(const PoseTracks& tracks,
                                      std::optional<double> allowance) const {
  const std::vector<int>& cameras = evidence_.observed.measurements.camera_of_frame;
  return whole_of(
      find_robot(recording(), at_common_instants(tracks, cameras), options_.calibrate, allowance),
      tracks);
}

Structure HypothesisFit::whole_of(Structure robot, const PoseTracks& tracks) const {
  Structure out = with_further_markers(std::move(robot), recording(), evidence_.observed, tracks,
                                       evidence_.camera);
  lap("structure");
  return out;
}

void HypothesisFit::lap(std::string_view stage) const {
  if (options_.lap) options_.lap(stage);
}

void HypothesisFit::close_loop(Explanation& out, const TraceStart& begin) const {
  const FreeGeometry free = options_.calibrate.free;
  out.fitted = closed_loop(out.start, free, out.fitted->calibration, begin);
  // An effect may have looked like another unit.
  if (!is_converged(out.fitted->calibration) ||
      !take_usual_units(out.fitted->calibration.tree, out.start))
    return;
  const Calibration plain = calibrated(out.start, free);
  lap("calibrate");
  out.fitted = closed_loop(out.start, free, plain, {out.fitted->trace.added});
}

}  // namespace kinescope
