// SPDX-License-Identifier: Apache-2.0
#include "app/commands/recording_command_line.h"

#include <fmt/format.h>

#include "app/commands/command_options.h"
#include "app/commands/torque_command_line.h"

namespace kinescope {
namespace {

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

}  // namespace

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

}  // namespace kinescope
