// SPDX-License-Identifier: Apache-2.0
#include "app/commands/command_line.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/command_options.h"
#include "app/commands/experiment_command_line.h"
#include "app/commands/export_command_line.h"
#include "app/commands/policy_command_line.h"
#include "app/commands/simulation_command_line.h"
#include "app/commands/torque_command_line.h"
#include "app/io/nearest_name.h"
#include "calib/vision/tag_detector.h"
#include "kinematics/core/csv.h"

namespace kinescope {
namespace {

/// Of what is measured on a board, m: more would be mm.
constexpr double kLongest = 10.0;

/// A finite length above zero, m.
CLI::Validator length_m() {
  return {[](const std::string& text) -> std::string {
            const std::optional<double> value = parse_number(text);
            if (value && *value > 0.0 && *value < kLongest) return {};
            return fmt::format("'{}' is no length in m above 0 and below {}", text, kLongest);
          },
          fmt::format("up to {} m", kLongest)};
}

/// One word of several.
template <typename Enum, typename Value>
CLI::Option* add_choice(CLI::App& command, const char* name,
                        const std::map<std::string, Enum>& words, Value& value, const char* help) {
  std::vector<std::string> known;
  for (const auto& [word, meaning] : words) known.push_back(word);
  const auto check = [words, known](const std::string& text) -> std::string {
    if (words.contains(text)) return {};
    return fmt::format("'{}' is not known; {}", text, did_you_mean(text, known));
  };
  return command
      .add_option_function<std::string>(
          name, [&value, words](const std::string& text) { value = words.at(text); }, help)
      ->check(check, "", fmt::format("{}", fmt::join(known, " ")));  // its name: for completion
}

std::string refuse_empty(const std::string& path) {
  return path.empty() ? "the path is empty" : "";
}

void add_path(CLI::App& command, const char* name, std::optional<std::filesystem::path>& path,
              const char* help) {
  command
      .add_option_function<std::string>(
          name, [&path](const std::string& text) { path = text; }, help)
      ->check(refuse_empty)
      ->type_name("FILE")
      ->group("Files in place of those in the recording");
}

void add_file_options(CLI::App& command, RecordingPaths& paths) {
  add_path(command, "--video", paths.video,
           "Video file, folder of images with times.csv, bag or dataset");
  add_path(command, "--joints", paths.joints,
           "Joint log: t in s, one column a channel; or bag, dataset");
  add_path(command, "--camera", paths.camera, "Intrinsics (ROS camera_info, Kalibr or OpenCV)");
  add_path(command, "--tags", paths.tags, "Marker family and sizes");
  add_path(command, "--corners", paths.corners, "Detected corners in place of a video; or bag");
  add_path(command, "--poses", paths.poses, "Marker poses in place of a video");
  add_path(command, "--points", paths.points, "3-D points in place of a video (needs --nominal)");
  add_path(command, "--nominal", paths.nominal,
           "Nominal robot (URDF): the start, and the model to beat");
}

void add_recording_options(CLI::App& command, RecordingPaths& paths, const char* help,
                           const char* type) {
  command
      .add_option_function<std::string>(
          "RECORDING", [&paths](const std::string& text) { paths.folder = text; }, help)
      ->check(refuse_empty)
      ->required()
      ->type_name(type);
  add_file_options(command, paths);
}

void add_estimation_options(CLI::App& run, CommandLine& line) {
  static const std::map<std::string, FreeGeometry> kFree = {{"placement", FreeGeometry::kPlacement},
                                                            {"offsets", FreeGeometry::kOffsets},
                                                            {"geometry", FreeGeometry::kGeometry}};
  CalibrateOptions& calibrate = line.run.calibrate;
  const char* group = "What is estimated";
  add_choice(
      run, "--free", kFree, line.run.free,
      "placement: base and markers; offsets: + joint zeros; geometry: + joint axes; default: with "
      "--nominal the one that predicts unseen postures best, else geometry")
      ->type_name("LEVEL")
      ->group(group);
  run.add_flag("--intrinsics", line.run.estimate_intrinsics,
               "Estimate the camera's intrinsics too (always so without camera.yaml)")
      ->group(group);
  run.add_flag("--no-time-offset", line.no_time_offset,
               "Trust the clocks of camera and log to agree")
      ->group(group);
  run.add_flag("--scales", calibrate.estimate_scales,
               "Estimate the scale of channels in rad or m too (ticks: always)")
      ->group(group);
  run.add_option("--folds", calibrate.folds, "Blocks of unseen postures to test on; 0: none")
      ->check(number_in(0, 50))
      ->capture_default_str()
      ->type_name("N")
      ->group(group);
}

void add_detection_options(CLI::App& run, DetectOptions& detect) {
  const char* group = "Detection";
  run.add_option("--threads", detect.threads, "Threads")
      ->check(number_in(1, 256))
      ->capture_default_str()
      ->type_name("N")
      ->group(group);
  run.add_option("--decimate", detect.detector.decimate,
                 "Search at 1/N of the resolution: faster, and misses small markers")
      ->check(number_in(1, 8))
      ->capture_default_str()
      ->type_name("N")
      ->group(group);
  run.add_option("--max-hamming", detect.detector.max_hamming,
                 "Wrong bits of a marker to forgive: finds more, and invents more [1; 2 of large "
                 "ArUco codes]")
      ->check(number_in(0, 2))
      ->type_name("BITS")
      ->group(group);
}

void add_judgement_options(CLI::App& run, RunOptions& options) {
  run.add_option("--fail-on", options.fail_on,
                 "Limit that turns the exit code to 5, such as \"held_out_px>0.2\" (in quotes: a "
                 "shell takes > for itself); may be given again")
      ->type_name("LIMIT")
      ->allow_extra_args(false);
  run.add_flag_callback(
      "--no-trace", [&options] { options.trace = false; },
      "Do not look for effects that the calibration lacks (trace.json)");
}

void add_run(CLI::App& app, CommandLine& line) {
  CLI::App& run = *app.add_subcommand("run", "From a recording to a URDF and a report");
  run.add_option_function<std::vector<std::string>>(
         "RECORDING",
         [&line](const std::vector<std::string>& folders) {
           line.run.recording.folder = folders.front();
           line.run.further.assign(folders.begin() + 1, folders.end());
         },
         "Folder with video.mp4, tags.yaml, joints.csv, camera.yaml; a bag of ROS; or a LeRobot "
         "dataset. Several of one robot are calibrated together; @FILE: those in a text file, one "
         "a "
         "line")
      ->check(refuse_empty)
      ->required()
      ->type_name("PATH");
  add_file_options(run, line.run.recording);
  run.add_option_function<std::string>(
         "-o,--output", [&line](const std::string& text) { line.run.output = text; },
         "Folder for the results (default: <recording>_run here)")
      ->type_name("FOLDER");
  add_estimation_options(run, line);
  add_detection_options(run, line.run.detect);
  add_shard(run, line.run.shard,
            "Of several recordings look for the markers in every N-th only, beginning with the "
            "I-th, and leave them in the output folder as a part for kinescope merge");
  add_judgement_options(run, line.run);
  add_force(
      run, line.run.force,
      "Run every stage again, also where nothing changed, and replace what others wrote in the "
      "output folder");
  add_output_options(run, line.output);
  run.footer(fmt::format(
      "A folder with flange.csv (poses of the robot's flange) in place of joints.csv gives the "
      "camera's place\non the hand, or before the base: hand_eye.json, hand_eye.urdf, a report.\n\n"
      "Example:\n  kinescope run sample_videos/scara4_none --output scara_run\n\n{}",
      kExitCodes));
}

void add_path_argument(CLI::App& command, const char* name, std::filesystem::path& path,
                       const char* help, const char* type) {
  command
      .add_option_function<std::string>(
          name, [&path](const std::string& text) { path = text; }, help)
      ->required()
      ->type_name(type);
}

void add_merge(CLI::App& app, CommandLine& line) {
  CLI::App& merge = *app.add_subcommand(
      "merge", "One robot from the parts that the shards of a run left, as the run in one piece");
  MergeOptions& options = line.merge;
  merge
      .add_option_function<std::vector<std::string>>(
          "PART",
          [&options](const std::vector<std::string>& folders) {
            options.parts.assign(folders.begin(), folders.end());
          },
          "Folders of kinescope run --shard 1/N, 2/N, .. N/N, all of one run; its recordings must "
          "still be where they were")
      ->check(refuse_empty)
      ->required()
      ->type_name("FOLDER");
  merge
      .add_option_function<std::string>(
          "-o,--output", [&options](const std::string& text) { options.output = text; },
          "Folder for the results (default: as of the run in one piece)")
      ->type_name("FOLDER");
  add_force(merge, options.force, kReplaceOthers);
  add_output_options(merge, line.output);
  merge.footer(
      fmt::format("Example:\n  kinescope run @recordings.txt --shard 1/2 --output part1\n"
                  "  kinescope run @recordings.txt --shard 2/2 --output part2\n"
                  "  kinescope merge part1 part2 --output robot_run\n\n{}",
                  kExitCodes));
}

void add_fleet(CLI::App& app, CommandLine& line) {
  CLI::App& fleet = *app.add_subcommand(
      "fleet", "Many robots, each from its own recordings, and a table of them, worst first");
  FleetOptions& options = line.fleet;
  add_path_argument(fleet, "ROBOTS", options.table,
                    "CSV file with the columns robot, recording; several rows of one robot are its "
                    "several recordings",
                    "FILE");
  add_path(fleet, "--camera", line.run.recording.camera, "Intrinsics of all recordings");
  add_path(fleet, "--tags", line.run.recording.tags, "Marker family and sizes of all");
  add_path(fleet, "--nominal", line.run.recording.nominal, "Nominal robot (URDF) of all");
  fleet
      .add_option_function<std::string>(
          "-o,--output", [&options](const std::string& text) { options.output = text; },
          "Folder for a run folder a robot and the table (default: <list>_fleet here)")
      ->type_name("FOLDER");
  add_shard(fleet, options.shard,
            "Run every N-th robot only, beginning with the I-th; the command without it then runs "
            "what is not done yet, and writes the table");
  add_estimation_options(fleet, line);
  add_detection_options(fleet, line.run.detect);
  add_judgement_options(fleet, line.run);
  add_force(fleet, options.force,
            "Run also what is done, and replace what others wrote in the output folder");
  add_output_options(fleet, line.output);
  fleet.footer(
      fmt::format("With --fail-on the exit code is 5 where any robot is outside a limit or without "
                  "an answer.\n\n"
                  "Example:\n  kinescope fleet robots.csv --output fleet\n\n{}",
                  kExitCodes));
}

void add_trace(CLI::App& app, CommandLine& line) {
  CLI::App& trace =
      *app.add_subcommand("trace", "Look again for effects that the calibration of a run lacks");
  add_path_argument(trace, "RUN_FOLDER", line.trace.run_folder,
                    "Folder of a finished run; its recording must still be where it was", "FOLDER");
  add_output_options(trace, line.output);
  trace.footer(fmt::format("Example:\n  kinescope trace scara4_none_run\n\n{}", kExitCodes));
}

void add_correct(CLI::App& app, CommandLine& line) {
  CLI::App& correct = *app.add_subcommand(
      "correct", "A joint log without the effects that a run found on its encoders and gears");
  add_path_argument(correct, "RUN_FOLDER", line.correct.run_folder, "Folder of a finished run",
                    "FOLDER");
  add_path_argument(correct, "LOG", line.correct.log, "Joint log with the recording's channels",
                    "FILE");
  correct
      .add_option_function<std::string>(
          "-o,--output", [&line](const std::string& text) { line.correct.output = text; },
          "File to write (default: joints_corrected.csv)")
      ->type_name("FILE");
  add_force(correct, line.correct.force, kReplaceFile);
  add_output_options(correct, line.output);
  correct.footer(fmt::format(
      "Example:\n  kinescope correct ur6_run new_joints.csv --output corrected.csv\n\n{}",
      kExitCodes));
}

void add_compare(CLI::App& app, CommandLine& line) {
  static const std::map<std::string, CompareLimit> kLimits = {{"change", CompareLimit::kChange},
                                                              {"carry", CompareLimit::kCarry},
                                                              {"any", CompareLimit::kAny}};
  CLI::App& compare = *app.add_subcommand(
      "compare", "What changed of one robot between its runs, and whether their models carry over");
  CompareOptions& options = line.compare;
  compare
      .add_option_function<std::vector<std::string>>(
          "RUN_FOLDER",
          [&options](const std::vector<std::string>& folders) {
            options.runs.assign(folders.begin(), folders.end());
          },
          "Folders of finished runs of one robot, two or more; the first is what the others are "
          "compared with")
      ->required()
      ->type_name("FOLDER");
  compare
      .add_option("--level", options.level,
                  "Probability of calling anything changed where nothing is; all numbers together")
      ->check(number_in(1e-6, 0.5))
      ->capture_default_str()
      ->type_name("P");
  add_choice(
      compare, "--fail-on", kLimits, options.fail_on,
      "What turns the exit code to 5: change (of the robot), carry (a model predicts another "
      "run's recording worse than its own model does), any of both; what could not be "
      "compared or tried counts")
      ->type_name("WHAT");
  compare
      .add_option_function<std::string>(
          "-o,--output", [&options](const std::string& text) { options.output = text; },
          "Folder for compare.json and compare.html (default: only prints)")
      ->type_name("FOLDER");
  add_force(compare, options.force, kReplaceOthers);
  add_output_options(compare, line.output);
  compare.footer(fmt::format(
      "Example:\n  kinescope compare march_run june_run --fail-on change --output compared\n\n{}",
      kExitCodes));
}

void add_plan_limits(CLI::App& plan, PlanCommandOptions& options) {
  const char* group = "What the robot may do";
  plan.add_option_function<std::string>(
          "--limits", [&options](const std::string& text) { options.limits = text; },
          "URDF whose joints, named as in the run, have the ranges and highest speeds to keep to "
          "(default: what the run recorded)")
      ->check(refuse_empty)
      ->type_name("FILE")
      ->group(group);
  plan.add_option("--range", options.range,
                  "Without limits: the recorded range of every joint times this, about its middle")
      ->check(number_in(0.1, 10.0))
      ->capture_default_str()
      ->type_name("FACTOR")
      ->group(group);
  plan.add_option("--speed", options.speed,
                  "Highest speed of every joint, of the highest that the run recorded; "
                  "accelerations by its square")
      ->check(number_in(0.01, 10.0))
      ->capture_default_str()
      ->type_name("FACTOR")
      ->group(group);
}

void add_plan(CLI::App& app, CommandLine& line) {
  static const std::map<std::string, design::Goal> kGoals = {{"tip", design::Goal::kTip},
                                                             {"axes", design::Goal::kAxes}};
  CLI::App& plan = *app.add_subcommand(
      "plan", "The next recording that tells most of a robot, and the uncertainty after it");
  PlanCommandOptions& options = line.plan;
  add_path_argument(plan, "RUN_FOLDER", options.source, "Folder of a finished run", "FOLDER");
  add_choice(plan, "--goal", kGoals, options.goal,
             "What is to be known best: tip (where the last links are, over the joints' ranges; "
             "default), axes (where the axes are)")
      ->type_name("WHAT");
  plan.add_option("--seconds", options.seconds, "Length of the motion [20]")
      ->check(number_in(1.0, 3600.0))
      ->type_name("S");
  plan.add_option("--postures", options.postures,
                  "As many postures at rest, one image each, in place of a motion [20, where the "
                  "run's recording is of such]")
      ->check(number_in(1, 200))
      ->type_name("N");
  add_plan_limits(plan, options);
  plan.add_option("--rate", options.rate_hz, "Frames of the camera, 1/s [as in the run]")
      ->check(number_in(0.1, 1000.0))
      ->type_name("HZ");
  plan.add_option("--seed", options.seed, "Of the postures that are looked at")
      ->capture_default_str()
      ->type_name("N");
  plan.add_option_function<std::string>(
          "-o,--output", [&options](const std::string& text) { options.output = text; },
          "Folder for plan.csv and plan.json (default: <run>_plan here)")
      ->type_name("FOLDER");
  add_force(plan, options.force, kReplaceOthers);
  add_output_options(plan, line.output);
  plan.footer(fmt::format(
      "Example:\n  kinescope plan ur6_run --limits ur6.urdf --seconds 15 --output next\n\n{}",
      kExitCodes));
}

void add_inspect(CLI::App& app, CommandLine& line) {
  CLI::App& inspect = *app.add_subcommand(
      "inspect", "What a recording or a torque log holds and what is wrong with it, in seconds");
  add_recording_options(inspect, line.inspect.recording,
                        "Folder with video.mp4, tags.yaml, joints.csv, camera.yaml; a bag of ROS; "
                        "a LeRobot dataset; or "
                        "a torque log",
                        "PATH");
  add_inspect_log_options(inspect, line);
  add_output_options(inspect, line.output);
  inspect.footer(
      fmt::format("Examples:\n  kinescope inspect sample_videos/scara4_none\n"
                  "  kinescope inspect torque_log.csv --robot robot.urdf\n\n{}",
                  kExitCodes));
}

void add_board_options(CLI::App& camera, BoardSpec& board) {
  static const std::map<std::string, BoardType> kBoards = {{"chessboard", BoardType::kChessboard},
                                                           {"charuco", BoardType::kCharuco},
                                                           {"aprilgrid", BoardType::kAprilGrid}};
  const char* group = "Board";
  add_choice(camera, "--board", kBoards, board.type, "chessboard, charuco or aprilgrid")
      ->required()
      ->type_name("TYPE")
      ->group(group);
  const auto count = [&](const char* name, int& value, const char* help) {
    camera.add_option(name, value, help)
        ->required()
        ->check(number_in(1, 100))
        ->type_name("N")
        ->group(group);
  };
  count("--columns", board.columns,
        "Inner corners (chessboard), squares (charuco) or tags (aprilgrid) across");
  count("--rows", board.rows, "The same down");
  camera
      .add_option("--square", board.square_m,
                  "Edge of a square, of a tag for aprilgrid; m, as measured")
      ->required()
      ->check(length_m())
      ->type_name("M")
      ->group(group);
  camera.add_option("--marker", board.marker_m, "charuco: edge of a marker, m")
      ->check(length_m())
      ->type_name("M")
      ->group(group);
  camera
      .add_option("--spacing", board.spacing, "aprilgrid: gap between tags as a share of the tag")
      ->check(number_in(0.01, 5))
      ->capture_default_str()
      ->type_name("SHARE")
      ->group(group);
  camera
      .add_option("--dictionary", board.dictionary,
                  "charuco: dictionary (DICT_5X5_100); aprilgrid: family")
      ->type_name("NAME")
      ->group(group);
  camera
      .add_flag("--legacy", board.legacy_charuco,
                "charuco: layout of OpenCV before 4.6 (even row counts)")
      ->group(group);
}

void add_camera(CLI::App& app, CommandLine& line) {
  static const std::map<std::string, DistortionModel> kModels = {
      {"plumb_bob", DistortionModel::kPlumbBob},
      {"rational_polynomial", DistortionModel::kRationalPolynomial},
      {"equidistant", DistortionModel::kEquidistant}};
  CLI::App& camera = *app.add_subcommand("camera", "Intrinsics from images or a video of a board");
  camera
      .add_option_function<std::string>(
          "SOURCE", [&line](const std::string& text) { line.camera.source = text; },
          "Folder of images, or a video")
      ->required()
      ->type_name("PATH");
  add_board_options(camera, line.camera.board);
  add_choice(camera, "--model", kModels, line.camera.calibration.model,
             "plumb_bob (default), rational_polynomial or equidistant")
      ->type_name("MODEL");
  camera
      .add_option_function<std::string>(
          "-o,--output", [&line](const std::string& text) { line.camera.output = text; },
          "ROS camera_info file to write (default: camera.yaml)")
      ->type_name("FILE");
  add_force(camera, line.camera.force, kReplaceFile);
  add_output_options(camera, line.output);
  camera.footer(fmt::format(
      "Example:\n  kinescope camera board_images --board chessboard --columns 9 --rows 6 "
      "--square 0.025\n\n{}",
      kExitCodes));
}

// "0-7,12" in its order, each id once; nothing where it says something else.
std::optional<std::vector<int>> parse_ids(const std::string& text) {
  constexpr int kMost = 1000;  // on a sheet
  std::vector<int> out;
  for (const std::string& part : CLI::detail::split(text, ',')) {
    const std::size_t dash = part.find('-');
    const auto first = parse_number(part.substr(0, dash));
    const auto last = dash == std::string::npos ? first : parse_number(part.substr(dash + 1));
    if (!first || !last || *first < 0.0 || *last < *first || *last - *first >= kMost ||
        *first > 1e9 || std::floor(*first) != *first || std::floor(*last) != *last)
      return std::nullopt;
    for (int id = static_cast<int>(*first); id <= static_cast<int>(*last); ++id) {
      if (std::ranges::find(out, id) == out.end()) out.push_back(id);
    }
    if (out.size() > kMost) return std::nullopt;
  }
  return out;
}

void add_markers(CLI::App& app, CommandLine& line) {
  static const std::map<std::string, Paper> kPapers = {{"A4", Paper::kA4},
                                                       {"letter", Paper::kLetter}};
  CLI::App& markers = *app.add_subcommand("markers", "A PDF of markers to print, in true size");
  MarkerSheet& sheet = line.markers.sheet;
  markers
      .add_option_function<std::string>(
          "--ids", [&sheet](const std::string& text) { sheet.ids = value_of(parse_ids(text)); },
          "Which markers: numbers and ranges, such as 0-7,12; at most 1000")
      ->check([](const std::string& text) -> std::string {
        return parse_ids(text) ? "" : fmt::format("'{}' names no markers (such as 0-7,12)", text);
      })
      ->required()
      ->type_name("IDS");
  markers.add_option("--size", sheet.size_m, "Edge of the black square, m (such as 0.04)")
      ->check(length_m())
      ->required()
      ->type_name("M");
  markers.add_option("--family", sheet.family, "As in tags.yaml (default: tag36h11)")
      ->type_name("NAME");
  add_choice(markers, "--paper", kPapers, sheet.paper, "A4 (default) or letter")
      ->type_name("PAPER");
  markers
      .add_option_function<std::string>(
          "-o,--output", [&line](const std::string& text) { line.markers.output = text; },
          "PDF to write (default: markers.pdf)")
      ->type_name("FILE");
  add_force(markers, line.markers.force, kReplaceFile);
  add_output_options(markers, line.output);
  markers.footer(
      fmt::format("Example:\n  kinescope markers --ids 0-7 --size 0.04\n\n{}", kExitCodes));
}

void add_capture_inputs(CLI::App& capture, CaptureOptions& options) {
  const char* group = "What is known";
  const auto add_file = [&](const char* name, std::optional<std::filesystem::path>& file,
                            const char* help) {
    capture
        .add_option_function<std::string>(
            name, [&file](const std::string& text) { file = text; }, help)
        ->check(refuse_empty)
        ->type_name("FILE")
        ->group(group);
  };
  capture
      .add_option("--size", options.size_m, "Edge of the markers' black square, m (such as 0.04)")
      ->check(length_m())
      ->type_name("M")
      ->group(group);
  capture
      .add_option("--family", options.family,
                  "As in tags.yaml (default: tag36h11, or what is seen where it is not)")
      ->check(one_of(known_families()))
      ->type_name("NAME")
      ->group(group);
  add_file("--tags", options.tags,
           "Marker family and sizes, to be copied (default: tags.yaml in the folder)");
  add_file("--camera", options.camera,
           "Intrinsics, to be copied (default: camera.yaml in the folder)");
  capture
      .add_option("--joints", options.joints,
                  "Joint values as lines of CSV, a header first: - (standard input), a pipe, or a "
                  "file that grows; stamped by its column t, else when they are received")
      ->check(refuse_empty)
      ->type_name("FILE")
      ->group(group);
}

void add_capture(CLI::App& app, CommandLine& line) {
  CLI::App& capture = *app.add_subcommand(
      "capture", "A recording from a running camera, with a page that says what it lacks");
  CaptureOptions& options = line.capture;
  capture
      .add_option(
          "SOURCE", options.source,
          "Camera (0, /dev/video0), stream (rtsp://.., http://..), or a video file, which is "
          "played at its own speed")
      ->check(refuse_empty)
      ->required()
      ->type_name("SOURCE");
  capture
      .add_option_function<std::string>(
          "-o,--output", [&options](const std::string& text) { options.output = text; },
          "Folder of the recording to make")
      ->required()
      ->type_name("FOLDER");
  add_capture_inputs(capture, options);
  capture
      .add_option("--port", options.port,
                  "Port of the page on 127.0.0.1; 0 (default): any that is free")
      ->check(number_in(0, 65535))
      ->type_name("N");
  capture.add_flag("--no-page", options.no_page, "Without a page: the recording begins at once");
  capture.add_option("--seconds", options.seconds, "Longest duration of the recording")
      ->check(number_in(0.1, 86400))
      ->type_name("S");
  add_force(capture, options.force, "Replace the recording that is in the folder");
  add_output_options(capture, line.output);
  capture.footer(fmt::format(
      "Examples:\n  kinescope capture 0 --size 0.04 -o arm\n  read_joints | kinescope capture "
      "rtsp://camera/stream --size 0.04 --joints - -o arm\n\n{}",
      kExitCodes));
}

}  // namespace

void add_commands(CLI::App& app, CommandLine& line) {
  app.name("kinescope");
  app.description("Learns a robot's body from a video of markers and a joint log");
  app.set_version_flag("--version", fmt::format("kinescope {}", KINESCOPE_VERSION));
  app.set_help_flag("--help,-h", "Print this help");
  app.require_subcommand(1);
  app.footer(
      fmt::format("Example:\n  kinescope inspect sample_videos/scara4_none\n  kinescope run "
                  "sample_videos/scara4_none\n\n{}",
                  kExitCodes));
  add_run(app, line);
  add_merge(app, line);
  add_fleet(app, line);
  add_trace(app, line);
  add_correct(app, line);
  add_compare(app, line);
  add_plan(app, line);
  add_dynamics(app, line);
  add_predict(app, line);
  add_simulate(app, line);
  add_control(app, line);
  add_export(app, line);
  add_contact(app, line);
  add_experiment(app, line);
  add_policy(app, line);
  add_inspect(app, line);
  add_camera(app, line);
  add_markers(app, line);
  add_capture(app, line);
}

}  // namespace kinescope
