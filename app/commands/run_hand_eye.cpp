// SPDX-License-Identifier: Apache-2.0
//
// `kinescope run` where the log holds poses of the flange: from markers to a camera on its hand.
#include "app/commands/run_hand_eye.h"

#include <algorithm>
#include <cstdio>

#include <fmt/format.h>

#include "app/commands/limits.h"
#include "app/commands/run_folder.h"
#include "app/explain/pipeline.h"
#include "app/io/flange_convention.h"
#include "app/io/json_text.h"
#include "app/io/products.h"
#include "app/report/hand_eye_summary.h"
#include "app/report/stopwatch.h"
#include "app/report/trace_json.h"
#include "app/report/trace_lines.h"
#include "calib/hand_eye/hand_eye.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "kinematics/urdf/camera_links.h"
#include "kinematics/urdf/urdf.h"

namespace kinescope {
namespace {

// flange (or base), camera_link, camera_optical_frame.
std::string hand_eye_urdf(const HandEye& result, const std::string& name) {
  const bool on_hand = result.hypothesis.mount == CameraMount::kOnHand;
  KinematicTree tree;
  tree.name = name;
  tree.links = {{on_hand ? "flange" : "base"}};
  return write_urdf(with_camera_links(std::move(tree), LinkId{0}, result.camera.T));
}

HandEyeInput hand_eye_input(const Recording& recording, Observed observed, const PoseTracks& tracks,
                            const CameraModel& camera) {
  HandEyeInput out;
  out.measurements = std::move(observed.measurements);
  out.tracks = tracks;
  out.markers = recording.markers;
  out.camera = camera;
  out.readings = recording.flange;
  // A moving hand that is one row late is late by a time, which tracing knows.
  const bool postures = is_posture_log(out.readings.front().log, out.measurements.times_s);
  if (postures && !recording.settings.flange) out.readings = with_moved_rows(out.readings);
  out.mount = recording.settings.camera_mount;
  return out;
}

std::string error_words(const HandEyeError& e) {
  return e.px > 0.0 ? fmt::format("{:.2g} px", e.px) : fmt::format("{:.2g} mm", 1e3 * e.m);
}

// That the log is read otherwise than it is documented, and how to make that sure.
std::optional<std::string> unusual_reading(const HandEye& result, const HandEyeInput& input) {
  const auto chosen =
      std::ranges::find(input.readings, result.hypothesis.rotation, &FlangeReading::rotation);
  if (chosen == input.readings.end() || chosen->declaration == FlangeDeclaration{})
    return std::nullopt;
  std::string out = fmt::format("{}: read as {}, which predicts unseen poses to {} (rms)",
                                chosen->log.source, chosen->rotation, error_words(result.held_out));
  const auto usual = std::ranges::find_if(result.rivals, [&](const HandEyeRival& rival) {
    return rival.hypothesis.rotation == input.readings.front().rotation;
  });
  if (usual != result.rivals.end() && !chosen->usual) {
    out += fmt::format(", as {} to {}", usual->hypothesis.rotation, error_words(usual->held_out));
  }
  return out + fmt::format(": if that is so, write \"{}\" into recording.yaml",
                           to_string(chosen->declaration));
}

// What limits of --fail-on speak of.
void take_errors(const HandEye& result, RunSummary& run) {
  const bool corners = result.held_out.px > 0.0;
  run.calibration.kind = corners ? MeasurementKind::kCorners : MeasurementKind::kPose;
  run.calibration.training_rms = corners ? result.fitted.px : result.fitted.m;
  run.calibration.held_out_rms = corners ? result.held_out.px : result.held_out.m;
  run.errors.all.held_out_m.rms = result.held_out.m;
  run.errors.all.held_out_rad.rms = result.held_out.rad;
  run.trace = result.trace;
}

void print_hand_eye(const HandEyeSummary& summary, const RunFolder& folder,
                    const Console& console) {
  if (console.json) {
    console.print(hand_eye_json(summary));
    return;
  }
  const Verdict verdict = hand_eye_verdict(summary);
  for (const std::string& words : {verdict.found, verdict.accurate, verdict.limits})
    if (!words.empty()) fmt::print("{}\n", words);
  if (summary.hand_eye.trace)
    for (const std::string& line : trace_lines(*summary.hand_eye.trace)) fmt::print("{}\n", line);
  for (const std::string& line : odd_row_lines(summary)) fmt::print("{}\n", line);
  if (!verdict.next.empty()) fmt::print("Next: {}\n", verdict.next);
  fmt::print("poses   {}\nurdf    {}\nreport  {}\n", folder.file("hand_eye.json").string(),
             folder.file("hand_eye.urdf").string(), folder.file("report.html").string());
}

void write_all(HandEyeSummary& summary, Stopwatch& clock, RunFolder& folder) {
  const std::string urdf = hand_eye_urdf(summary.hand_eye, summary.run.robot);
  folder.begin_products();
  if (!summary.run.tracks.tracks.empty())
    folder.write("tracks.csv", tracks_csv(summary.run.tracks));
  folder.write("hand_eye.json", json_text(hand_eye_json(summary)));
  folder.write("hand_eye.urdf", urdf);
  if (summary.hand_eye.trace)
    folder.write("trace.json", json_text(trace_json(*summary.hand_eye.trace)));
  folder.write("report.html", hand_eye_report_html(summary, urdf));
  clock.lap("write", summary.run.times);
  folder.add_products({std::string(kRunFile)});
  folder.remove_stale_products();
  folder.write(kRunFile, json_text(run_json(summary.run, folder.products()), 2));
}

}  // namespace

ExitCode run_hand_eye(const RunOptions& options, const Recording& recording,
                      const Console& console) {
  Stopwatch clock;
  HandEyeSummary summary;
  RunSummary& run = summary.run;
  const std::vector<Limit> limits = parse_limits(options.fail_on);
  RunFolder folder(options, recording);
  if (options.must_trace) require_same_inputs(options.output, recording);
  Observed observed = observe(recording, options, recording.camera,
                              folder.cached_observations(recording), console.progress);
  const CameraModel camera = choose_camera(recording, observed.tags);
  const PoseLog& log = recording.flange.front().log;
  require_time_overlap(log, observed.measurements.times_s, "the video");
  summary.log = std::filesystem::path(log.source).filename().string();
  summary.time_column = log.time_column;
  describe_input(recording, observed, options, run);
  for (const std::string& warning : run.warnings) console.warn(warning);
  clock.lap("detect", run.times);

  run.tracks = observed.tags.observations.empty()
                   ? observed.measurements.poses
                   : pose_tracks_from_tags(observed.tags, camera, recording.markers);
  const TagObservations tags = all_tags(observed);
  HandEyeOptions hand_eye;
  hand_eye.reject_sigma = options.calibrate.reject_sigma;
  hand_eye.folds = options.calibrate.folds;
  hand_eye.trace = options.trace;
  const HandEyeInput input = hand_eye_input(recording, std::move(observed), run.tracks, camera);
  summary.hand_eye = calibrate_hand_eye(input, hand_eye, console.progress);
  if (const auto unusual = unusual_reading(summary.hand_eye, input)) {
    run.warnings.push_back(*unusual);
    console.warn(*unusual);
  }
  clock.lap("calibrate", run.times);
  take_errors(summary.hand_eye, run);
  folder.keep_observations(recording, tags);
  write_all(summary, clock, folder);
  print_hand_eye(summary, folder, console);
  if (options.must_trace) require_trace(run);
  return within_limits(run, limits, console) ? ExitCode::kDone : ExitCode::kOutsideLimits;
}

}  // namespace kinescope
