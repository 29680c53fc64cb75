// SPDX-License-Identifier: Apache-2.0
//
// `kinescope run`: every arrow of the data's path on one page.
#include <algorithm>
#include <cstdio>
#include <map>

#include <fmt/format.h>

#include "app/commands/commands.h"
#include "app/commands/limits.h"
#include "app/commands/run_folder.h"
#include "app/commands/run_hand_eye.h"
#include "app/commands/run_shard.h"
#include "app/commands/shard_parts.h"
#include "app/commands/torque_stages.h"
#include "app/explain/across_recordings.h"
#include "app/explain/explain.h"
#include "app/explain/first_look.h"
#include "app/explain/join_recordings.h"
#include "app/explain/log_doubts.h"
#include "app/explain/moving_camera.h"
#include "app/explain/pipeline.h"
#include "app/explain/see_alone.h"
#include "app/explain/see_cameras.h"
#include "app/explain/see_recordings.h"
#include "app/explain/sighting_doubts.h"
#include "app/io/effects_file.h"
#include "app/io/joint_values_file.h"
#include "app/io/json_text.h"
#include "app/io/products.h"
#include "app/report/answer.h"
#include "app/report/findings.h"
#include "app/report/recordings_json.h"
#include "app/report/report.h"
#include "app/report/stopwatch.h"
#include "app/report/trace_json.h"
#include "app/report/trace_lines.h"
#include "app/report/verdict_words.h"
#include "calib/bundle/branches.h"
#include "calib/bundle/postures.h"
#include "calib/effects/corrected_log.h"
#include "calib/quality/error_summary.h"
#include "calib/quality/odd_readings.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "calib/tracks/several_cameras.h"
#include "calib/vision/repeated_frames.h"
#include "calib/vision/stills.h"
#include "kinematics/core/file.h"
#include "kinematics/core/mean_step.h"
#include "kinematics/urdf/calibrated_urdf.h"
#include "kinematics/urdf/camera_links.h"
#include "kinematics/urdf/urdf.h"

namespace kinescope {
namespace {

constexpr std::string_view kReport = "report.html";
// Of a run without an answer, beside the products of an earlier one that has one.
constexpr std::string_view kFailedReport = "failed_report.html";
constexpr std::string_view kNominalCalibrated = "nominal_calibrated.urdf";

/// Joints of one channel follow one another in a URDF; one of them that an effect moves beside its
/// channel does not.
KinematicTree without_false_mimics(KinematicTree tree, const std::vector<FittedEffect>& effects) {
  for (Joint& joint : tree.joints) {
    if (std::ranges::find(effects, joint.name,
                          [](const FittedEffect& effect) -> const std::string& {
                            return effect.id.place;
                          }) != effects.end())
      joint.channel.clear();
  }
  return tree;
}

void describe_recording(const Recording& recording, const Observed& observed,
                        const RunOptions& options, RunSummary& run) {
  describe_input(recording, observed, options, run);
  if (run.frames > 1) {
    run.duration_s = frame_times(observed).back() - frame_times(observed).front();
  }
  std::map<std::string, int> rejected;
  const TagObservations& tags = all_tags(observed);
  for (const RejectedTag& tag : tags.rejected) ++rejected[tag.reason];
  run.rejected.assign(rejected.begin(), rejected.end());
  for (const std::vector<std::string>& more :
       {clock_jump_words(recording.log), frozen_log_words(recording.log, observed),
        uncovered_words(recording.log, frame_times(observed)), unlisted_marker_words(tags),
        repeated_frame_words(tags)}) {
    run.warnings.insert(run.warnings.end(), more.begin(), more.end());
  }
  run.camera_declared = recording.camera.has_value() || observed.tags.observations.empty();
  run.log = recording.log;
  run.nominal = recording.nominal;
  run.free_asked = options.free.has_value();
}

// Motion between the readings of a slow log is interpolated: all that moves is then off by a time,
// too.
std::string jitter_words(double jitter_s, const JointLog& log, const Observed& observed) {
  const double log_step = log.size() > 1 ? mean_step_s(log.times_s) : 0.0;
  if (log_step > mean_step_s(frame_times(observed))) {
    return fmt::format(
        "the frames and the joint log scatter by {:.2g} ms (standard deviation) about each other: "
        "{} has {:.2g} readings a second, and the motion between them is interpolated: log faster",
        1e3 * jitter_s, log.source, 1.0 / log_step);
  }
  return fmt::format(
      "the frames' stamps scatter by {:.2g} ms (standard deviation) about the joint log's clock: "
      "use stamps of the camera's own clock, or a camera that is triggered",
      1e3 * jitter_s);
}

void print_result(const RunSummary& run, const RunFolder& folder, std::string_view report,
                  const Console& console) {
  if (console.json) {
    console.print(result_json(run));
    return;
  }
  const Verdict verdict = make_verdict(run);
  fmt::print("{}\n{}\n{}\n", verdict.found, verdict.accurate, verdict.limits);
  if (run.trace) {
    for (const std::string& line : trace_lines(*run.trace)) fmt::print("{}\n", line);
  }
  for (const std::string& line : second_column_lines(run.second_columns)) fmt::print("{}\n", line);
  for (const std::string& line : run.torque) fmt::print("{}\n", line);
  if (!verdict.next.empty()) fmt::print("Next: {}\n", verdict.next);
  if (report == kReport) {
    if (const std::string words = report::beside_urdf_words(run); !words.empty())
      fmt::print("{}\n", report::sentence(words));
    const std::string_view caveat = judge(run).given ? "" : " (no answer: see above)";
    fmt::print("urdf    {}{}\n", folder.file("robot.urdf").string(), caveat);
    if (run.nominal)
      fmt::print("nominal {} (the nominal file with calibrated joints, all else as it was){}\n",
                 folder.file(kNominalCalibrated).string(), caveat);
  }
  fmt::print("report  {}\n", folder.file(report).string());
}

void write_tracks(const RunSummary& run, RunFolder& folder) {
  if (!run.tracks.tracks.empty()) folder.write("tracks.csv", tracks_csv(run.tracks));
}

void write_structure(const RunSummary& run, RunFolder& folder) {
  if (!run.structure) return;
  folder.write("structure.json", json_text(structure_json(*run.structure, run.log), 2));
}

void write_products(const RunSummary& run, const std::string& urdf, RunFolder& folder) {
  folder.begin_products();
  write_tracks(run, folder);
  write_structure(run, folder);
  folder.write("robot.urdf", urdf);
  nlohmann::json calibration = calibration_json(run.calibration);
  if (!run.recordings.empty()) calibration["recordings"] = recordings_json(run);
  calibration["effects"] = effects_json(run.effects);
  if (run.gravity_base) calibration["gravity_base"] = *run.gravity_base;
  if (run.calibration.moving && !run.calibration.moving->on_robot())
    folder.write("camera_path.csv", camera_path_csv(run.calibration));
  folder.write("joint_values.csv", joint_values_csv(run.calibration));
  if (!run.log.unit_factors.empty()) calibration["unit_factors"] = run.log.unit_factors;
  folder.write("calibration.json", json_text(calibration));
  folder.write("residuals.csv", residuals_csv(run.calibration));
  if (run.trace) folder.write("trace.json", json_text(trace_json(*run.trace)));
  folder.write("result.json", json_text(result_json(run), 2));
}

/// What can stand for the nominal file on a robot: robot.urdf has none of its masses, shapes and
/// drives, but the markers.
void write_calibrated_nominal(const RunSummary& run, const Recording& recording,
                              RunFolder& folder) {
  if (!run.nominal) return;
  folder.write(kNominalCalibrated,
               with_calibrated_joints(read_text_file(recording.nominal_file),
                                      recording.nominal_file.string(), run.calibration.tree));
}

/// A recording shows a part of what a robot may do; where it goes beyond the limits, so do they.
KinematicTree with_nominal_limits(KinematicTree tree, const KinematicTree& nominal) {
  for (Joint& joint : tree.joints) {
    const std::optional<JointId> same = nominal.joint(joint.name);
    if (!same) continue;
    const std::optional<JointLimits>& drawn = nominal.joints[same->index()].limits;
    if (joint.limits && drawn) {
      joint.limits = JointLimits{std::min(joint.limits->lower, drawn->lower),
                                 std::max(joint.limits->upper, drawn->upper)};
    } else {
      joint.limits = drawn;
    }
  }
  return tree;
}

/// A camera that rides on the robot is a link of it.
KinematicTree with_camera(const Calibration& calibration) {
  const std::optional<MovingCamera>& moving = calibration.moving;
  if (!moving || !moving->on_robot()) return calibration.tree;
  return with_camera_links(calibration.tree, moving->link, moving->T_camera_link.inverse());
}

/// Of one camera, or of all; of one recording, or of all.
SeenTogether look(const std::vector<Recording>& given, const RunOptions& options,
                  const RunFolder& folder, const Progress& progress) {
  const auto see = [&](const Recording& one) {
    auto kept = observations_in(options.parts, one, options.detect);
    if (!kept) kept = folder.cached_observations(one);
    return see_alone(one, options, kept, progress);
  };
  if (given.size() > 1) return see_recordings(given, options, see);
  const Recording& recording = given.front();
  if (!recording.cameras.empty()) return see_cameras(recording, options, see);
  SeenAlone alone = see(recording);
  PoseTracks tracks =
      alone.observed.tags.observations.empty()
          ? alone.observed.measurements.poses
          : pose_tracks_from_tags(alone.observed.tags, alone.camera, recording.markers);
  return {std::move(alone.observed), alone.camera, std::move(tracks), recording};
}

void keep_observations(const std::vector<Recording>& given, const SeenTogether& seen,
                       RunFolder& folder) {
  for (std::size_t k = 0; k < seen.detected.size(); ++k)
    folder.keep_observations(given[k], seen.detected[k]);
  if (given.size() > 1) return;
  const Recording& recording = given.front();
  const Observed& observed = seen.observed;
  if (recording.cameras.empty()) folder.keep_observations(recording, all_tags(observed));
  for (const RecordedCamera& camera : recording.cameras) {
    const auto used = std::ranges::find(observed.cameras, camera.name, &ObservedCamera::name);
    if (used != observed.cameras.end())
      folder.keep_observations(of_camera(recording, camera), all_tags(*used));
  }
}

std::string odd_words(const OddReading& odd, const Recording& recording) {
  return fmt::format(
      "{}: at {} = {:.6g} '{}' reads {:.6g}, but the markers it moves say {:.6g}: left out",
      recording.log.source, recording.log.time_column, odd.time_s, odd.channel, odd.read,
      odd.expected);
}

ExplainOptions explain_options(const RunOptions& options, RunSummary& run, Stopwatch& clock,
                               const Progress& progress) {
  ExplainOptions out;
  out.calibrate = options.calibrate;
  out.calibrate.estimate_intrinsics = options.estimate_intrinsics || !run.camera_declared;
  out.calibrate.free = options.free.value_or(FreeGeometry::kGeometry);
  out.free = options.free;
  out.trace = options.trace;
  out.lap = [&](std::string_view stage) { clock.lap(std::string(stage), run.times); };
  out.progress = progress;
  return out;
}

// What `kinescope correct` takes out of a log like this one.
std::vector<EffectId> shown_by_log(const RunSummary& run) {
  if (run.effects.empty()) return {};
  try {
    return corrected_log(run.log, run.calibration.tree, run.effects, run.gravity_base).undone;
  } catch (const Error&) {
    return {};  // it says why, when it is asked
  }
}

void take(TracedCalibration fitted, const Recording& recording, const Observed& observed,
          const RunOptions& options, RunSummary& run) {
  run.calibration = std::move(fitted.calibration);
  run.effects = std::move(fitted.effects);
  run.gravity_base = fitted.gravity_base;
  run.shown_by_log = shown_by_log(run);
  const bool of_postures = shows_postures(run.calibration.tree, run.log, run.calibration.times_s);
  if (options.trace) {
    run.trace = std::move(fitted.trace);
    run.second_columns =
        second_columns(run.log, run.calibration.tree, run.gravity_base, of_postures);
  }
  if (fitted.stamp_jitter_s > 0.0)
    run.warnings.push_back(jitter_words(fitted.stamp_jitter_s, run.log, observed));
  if (!of_postures) return;
  for (const OddReading& odd : odd_readings(run.calibration, run.tracks, run.log))
    run.warnings.push_back(odd_words(odd, recording));
}

// Frames of the (reference) camera for the report, spread evenly over those of which the
// calibration used the most markers.
void add_film(const Recording& recording, RunSummary& run) {
  constexpr std::size_t kMostStills = 24;  // with their markers about half a megabyte
  constexpr int kStillWidth = 480;         // px
  if (recording.entry != RecordingEntry::kVideo || recording.video.empty()) return;
  std::map<int, int> used;
  int most = 0;
  for (const SightingResidual& residual : run.calibration.residuals)
    if (residual.used && run.calibration.camera_at(residual.frame) == 0)
      most = std::max(most, ++used[residual.frame]);
  std::vector<int> frames;
  for (const auto& [frame, markers] : used)
    if (2 * markers >= most) frames.push_back(frame);
  const std::size_t count = std::min(kMostStills, frames.size());
  std::vector<double> times_s;
  for (std::size_t k = 0; k < count; ++k) {
    const int frame = frames[k * (frames.size() - 1) / std::max<std::size_t>(1, count - 1)];
    times_s.push_back(run.calibration.times_s[static_cast<std::size_t>(frame)] -
                      recording.settings.video_start_s);
  }
  run.film = stills_at(recording.video, times_s, kStillWidth);
  for (Still& still : run.film) still.time_s += recording.settings.video_start_s;
}

// What is free of the robot that is exported.
FreeGeometry exported_freedom(const Explanation& of) {
  const auto level = std::ranges::find_if(of.levels, &FreedomLevel::exported);
  return level == of.levels.end() ? FreeGeometry::kGeometry : level->free;
}

std::vector<RecordingSummary> across(const Evidence& evidence, const Explanation& best,
                                     const RunOptions& options, const RunSummary& run,
                                     const Progress& progress) {
  if (evidence.observed.measurements.starts_s.empty()) return {};
  report_progress(progress, "leave recordings out", 0, 1);
  CalibrateOptions calibrate = options.calibrate;
  calibrate.estimate_intrinsics = options.estimate_intrinsics || !run.camera_declared;
  calibrate.free = exported_freedom(best);
  std::vector<RecordingSummary> out = across_recordings(evidence, best, calibrate);
  report_progress(progress, "leave recordings out", 1, 1);
  return out;
}

// Without a nominal robot there is no geometry to hold.
void require_nominal(const RunOptions& options, const Recording& recording) {
  if (!options.free || *options.free == FreeGeometry::kGeometry || recording.nominal) return;
  throw bad_request("--free", "placement and offsets hold the geometry of a nominal robot",
                    "name the robot with --nominal, or leave --free out");
}

}  // namespace

ExitCode run_command(const RunOptions& options, const Console& console) {
  if (options.shard) return run_shard(options, console);
  Stopwatch clock;
  RunSummary run;
  const std::vector<Limit> limits = parse_limits(options.fail_on);
  const std::vector<Recording> given = read_recordings(options.recording, options.further);
  require_unchanged(options.parts, given);
  const Recording whole = described_together(given);
  require_nominal(options, whole);
  if (!whole.flange.empty()) return run_hand_eye(options, whole, console);
  RunFolder folder(options, whole);
  if (options.must_trace) require_same_inputs(options.output, whole);
  clock.lap("read", run.times);

  SeenTogether seen = look(given, options, folder, console.progress);
  Recording& recording = seen.recording;
  const Observed& observed = seen.observed;
  describe_recording(recording, observed, options, run);
  for (const std::string& warning : run.warnings) console.warn(warning);
  // What was found is kept also where it leads to no answer, but never over an earlier answer.
  const bool answered = folder.holds_answer();
  if (!answered) keep_observations(given, seen, folder);
  clock.lap("detect", run.times);

  run.tracks = std::move(seen.tracks);
  if (!answered) write_tracks(run, folder);
  clock.lap("track", run.times);

  run.camera_motion = settle_camera(observed, run.tracks, options.calibrate, recording);
  std::optional<Structure> structure =
      require_plausible_motion(recording,
                               at_common_instants(as_of_fixed_camera(recording, run.tracks),
                                                  observed.measurements.camera_of_frame),
                               options.calibrate);
  const Evidence evidence{recording, observed, run.tracks, seen.camera, std::move(structure)};
  const std::size_t told = run.warnings.size();
  Explanation best =
      explain(evidence, explain_options(options, run, clock, console.progress), run.warnings);
  if (best.fitted) run.recordings = across(evidence, best, options, run, console.progress);
  run.log = std::move(best.log);
  run.structure = std::move(best.structure);
  run.nominal_faults = std::move(best.nominal_faults);
  run.levels = std::move(best.levels);
  if (!answered) write_structure(run, folder);
  if (best.failure) throw Error(*best.failure);
  run.tracks = placed_again(std::move(best.tracks), observed, value_of(best.fitted).calibration);
  take(std::move(value_of(best.fitted)), recording, observed, options, run);
  for (std::size_t k = told; k < run.warnings.size(); ++k) console.warn(run.warnings[k]);
  run.tracks = with_branches_of(run.calibration, std::move(run.tracks));
  run.errors = summarise_errors(run.calibration);
  add_film(recording, run);

  const KinematicTree tree = without_false_mimics(with_camera(run.calibration), run.effects);
  const std::string urdf =
      run.nominal ? write_urdf(with_nominal_limits(tree, *run.nominal), LimitSource::kRobotFile)
                  : write_urdf(tree);
  const Answer answer = judge(run);
  if (answered && !answer.given) {
    folder.write(kFailedReport, report_html(run, urdf));
    print_result(run, folder, kFailedReport, console);
    require(answer, fmt::format("{} shows the details, the earlier answer stays",
                                folder.file(kFailedReport).string()));
  }
  if (answered) keep_observations(given, seen, folder);
  write_products(run, urdf, folder);
  write_calibrated_nominal(run, recording, folder);
  clock.lap("write", run.times);
  const TorqueStages torque =
      torque_stages(recording, options, run.calibration, folder.file(""), console.progress);
  run.torque = torque.words;
  folder.add_products(torque.products);
  if (!run.torque.empty()) clock.lap("torque", run.times);
  folder.write(kReport, report_html(run, urdf));
  clock.lap("report", run.times);
  folder.add_products({std::string(kRunFile)});
  folder.remove_stale_products();
  folder.write(kRunFile, json_text(run_json(run, folder.products()), 2));

  print_result(run, folder, kReport, console);
  require(answer, "the report shows the details");
  if (options.must_trace) require_trace(run);
  return within_limits(run, limits, console) ? ExitCode::kDone : ExitCode::kOutsideLimits;
}

}  // namespace kinescope
