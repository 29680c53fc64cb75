// SPDX-License-Identifier: Apache-2.0
#include "app/commands/run_folder_command_line.h"

#include <fmt/format.h>

#include "app/commands/command_options.h"

namespace kinescope {
namespace {

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

}  // namespace

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

}  // namespace kinescope
