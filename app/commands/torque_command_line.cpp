// SPDX-License-Identifier: Apache-2.0
#include "app/commands/torque_command_line.h"

#include <fmt/format.h>

#include "app/commands/command_options.h"

namespace kinescope {
namespace {

template <typename Path>
CLI::Option* add_files(CLI::App& command, const char* name, Path& paths, const char* help,
                       bool required) {
  return command
      .add_option_function<std::vector<std::string>>(
          name,
          [&paths](const std::vector<std::string>& texts) {
            paths.assign(texts.begin(), texts.end());
          },
          help)
      ->required(required)
      ->type_name("FILE");
}

void add_robot(CLI::App& command, std::filesystem::path& robot) {
  command
      .add_option_function<std::string>(
          "--robot", [&robot](const std::string& text) { robot = text; },
          "The robot (URDF), from kinescope run or any other")
      ->required()
      ->type_name("FILE");
}

}  // namespace

void add_log_options(CLI::App& command, CommandLine& line, TorqueDataOptions& data) {
  const char* group = "What the log's columns are (default: by their names)";
  LogMapping& mapping = data.mapping;
  command
      .add_option_function<std::string>(
          "--settings", [&line](const std::string& text) { line.settings = text; },
          "File with the key dynamics (default: recording.yaml beside the first log)")
      ->type_name("FILE")
      ->group(group);
  const auto list = [&](const char* name, std::vector<std::string>& words, const char* help) {
    command.add_option(name, words, help)->delimiter(',')->type_name("LIST")->group(group);
  };
  list("--position", mapping.position, "Columns of the joint positions, or one with *");
  list("--velocity", mapping.velocity, "Columns of the velocities");
  list("--acceleration", mapping.acceleration, "Columns of the accelerations");
  list("--torque", mapping.torque, "Columns of the torques or motor currents");
  list("--position-unit", mapping.position_unit, "rad, deg, m or mm; one for all or one a joint");
  list("--velocity-unit", mapping.velocity_unit, "rad/s, deg/s, m/s or mm/s");
  list("--torque-unit", mapping.torque_unit, "Nm, N, mNm, kNm, A, mA or %");
  command
      .add_option("--torque-factor", mapping.torque_factor,
                  "Joint torque per logged value: sign, gear or drive gain")
      ->delimiter(',')
      ->type_name("LIST")
      ->group(group);
  command.add_option("--time", mapping.time, "Column of the stamps")
      ->type_name("NAME")
      ->group(group);
  command.add_option("--time-unit", mapping.time_unit, "s, ms, us or ns")
      ->type_name("UNIT")
      ->group(group);
  command.add_option("--rate", mapping.rate_hz, "Samples per second of a log without stamps")
      ->check(number_in(0.1, 1e6))
      ->type_name("HZ")
      ->group(group);
}

void add_cutoff(CLI::App& command, TorqueDataOptions& data) {
  command
      .add_option("--cutoff", data.motion.cutoff_hz,
                  "Cut-off of the low-pass for motion and torque (default: chosen from the log)")
      ->check(number_in(1e-3, 1e6))
      ->type_name("HZ");
}

void add_inspect_log_options(CLI::App& inspect, CommandLine& line) {
  inspect
      .add_option_function<std::string>(
          "--robot", [&line](const std::string& text) { line.inspect.robot = text; },
          "URDF whose joints and masses a torque log must fit")
      ->type_name("FILE");
  add_log_options(inspect, line, line.inspect.data);
}

void add_dynamics(CLI::App& app, CommandLine& line) {
  CLI::App& command =
      *app.add_subcommand("dynamics", "From a log with torques and a URDF to a torque model");
  DynamicsOptions& dynamics = line.dynamics;
  add_files(command, "LOG", dynamics.logs,
            "Joint logs with torques: CSV, also gzipped, MAT-files, bags, datasets", true);
  add_robot(command, dynamics.robot);
  add_files(command, "--test", dynamics.test_logs,
            "Logs to judge on (default: the last part of the log)", false);
  command
      .add_option(
          "--model", dynamics.models,
          "parametric, rbf, gip, model_based, semi_parametric, lip, svr, network, or all "
          "(minutes); "
          "default: parametric, gip and semi_parametric, the last two quickly, through inducing "
          "points")
      ->delimiter(',')
      ->type_name("LIST");
  command
      .add_option_function<std::string>(
          "--split",
          [&dynamics](const std::string& text) { dynamics.split_at_random = text == "random"; },
          "What is held out without --test: blocks (whole trajectories, or the log's last part) or "
          "random (samples by lot, which flatters: for published tables made so)")
      ->check(CLI::IsMember({"blocks", "random"}))
      ->excludes("--test")
      ->type_name("HOW");
  add_gravity(command, dynamics.gravity_m_s2);
  command.add_flag("--gains", dynamics.models_options.identify.gains,
                   "Estimate a gain a joint: currents, or doubtful drive constants");
  const char* load = "What the robot carries";
  command
      .add_flag("--payload", dynamics.payload,
                "Mass and centre of what the last link carries and the URDF lacks; the URDF's "
                "masses are trusted")
      ->group(load);
  add_files(command, "--unloaded", dynamics.unloaded_logs,
            "Logs of the same robot without the load: no masses are needed", false)
      ->group(load);
  command
      .add_option("--payload-link", dynamics.payload_link,
                  "Link that carries it (default: the last one)")
      ->type_name("LINK")
      ->group(load);
  command.add_flag_callback(
      "--robust", [&dynamics] { dynamics.robust = true; },
      "Robust regressions (trimmed, Student's t) beside the models; with --model all anyway");
  command.add_flag_callback(
      "--no-robust", [&dynamics] { dynamics.robust = false; }, "None, nor a payload at rest");
  command.add_flag_callback(
      "--no-trace", [&dynamics] { dynamics.trace = false; },
      "Do not look for effects beyond rigid bodies (trace.json)");
  command.add_flag("--learning-curve", dynamics.learning_curve,
                   "The score of every model against the number of samples (slow)");
  command
      .add_option("--samples", dynamics.models_options.samples,
                  "Training samples of a Gaussian process")
      ->check(number_in(50, 200000))
      ->capture_default_str()
      ->type_name("N");
  command
      .add_option("--inducing", dynamics.models_options.inducing_points,
                  "Learn from all samples through so many inducing points (default models: from "
                  "--samples through 200)")
      ->check(number_in(10, 20000))
      ->type_name("N");
  command
      .add_option_function<std::string>(
          "--save-model", [&dynamics](const std::string& text) { dynamics.save_model = text; },
          "Write the model to rely on, or the one named, for kinescope predict and controllers: "
          "parametric (with what tracing found), rbf, gip, semi_parametric")
      ->type_name("FILE");
  add_log_options(command, line, dynamics.data);
  add_cutoff(command, dynamics.data);
  command
      .add_option_function<std::string>(
          "-o,--output", [&dynamics](const std::string& text) { dynamics.output = text; },
          "Folder for the results (default: <first log's name>_dynamics here)")
      ->type_name("FOLDER");
  add_force(command, dynamics.force, kReplaceOthers);
  add_output_options(command, line.output);
  command.footer(
      fmt::format("Examples:\n"
                  "  kinescope dynamics log.csv --robot robot.urdf --test log_test.csv\n"
                  "  kinescope dynamics loaded.csv --robot robot.urdf --unloaded empty.csv\n\n{}",
                  kExitCodes));
}

void add_predict(CLI::App& app, CommandLine& line) {
  CLI::App& command = *app.add_subcommand(
      "predict", "From a log and a learned torque model to predicted torques, bands and residuals");
  PredictOptions& predict = line.predict;
  add_files(command, "LOG", predict.logs,
            "Joint logs with torques: CSV, also gzipped, MAT-files, bags, datasets", true);
  command
      .add_option_function<std::string>(
          "--model", [&predict](const std::string& text) { predict.model = text; },
          "The model, from kinescope dynamics --save-model; it knows the robot")
      ->required()
      ->type_name("FILE");
  add_log_options(command, line, predict.data);
  command
      .add_option_function<std::string>(
          "-o,--output", [&predict](const std::string& text) { predict.output = text; },
          "Table of every sample and joint (default: <first log's name>_predicted.csv here)")
      ->type_name("FILE");
  add_force(command, predict.force, kReplaceFile);
  add_output_options(command, line.output);
  command.footer(fmt::format(
      "Example:\n  kinescope dynamics log.csv --robot robot.urdf --save-model torque.json\n"
      "  kinescope predict next_log.csv --model torque.json\n\n{}",
      kExitCodes));
}

void add_contact(CLI::App& app, CommandLine& line) {
  CLI::App& command =
      *app.add_subcommand("contact", "From a log with torques and a robot to the contacts in it");
  ContactCommandOptions& contact = line.contact;
  add_files(command, "LOG", contact.logs,
            "Joint logs with torques: CSV, also gzipped, MAT-files, bags, datasets", true);
  add_robot(command, contact.robot);
  add_files(command, "--learn", contact.learn_logs,
            "Logs of free motion to learn from beside the log itself (default: none)", false);
  command.add_flag("--identify", contact.identify,
                   "Masses and friction from the log to learn from (always so where the URDF has "
                   "none, or the log holds currents)");
  command
      .add_option("--model", contact.model,
                  "Look at what a torque model does not predict, in units of its own sigma: a file "
                  "of kinescope dynamics --save-model, or parametric, gip, semi_parametric, rbf to "
                  "learn one (default: the balance of momentum, which is compared)")
      ->type_name("FILE|NAME");
  command
      .add_option("--false-alarms", contact.contact.false_alarms_per_hour,
                  "False alarms an hour that are allowed")
      ->check(number_in(1e-3, 3600))
      ->capture_default_str()
      ->type_name("N");
  add_gravity(command, contact.gravity_m_s2);
  add_log_options(command, line, contact.data);
  add_cutoff(command, contact.data);
  command
      .add_option_function<std::string>(
          "-o,--output", [&contact](const std::string& text) { contact.output = text; },
          "Folder for the results (default: <first log's name>_contact here)")
      ->type_name("FOLDER");
  add_force(command, contact.force, kReplaceOthers);
  add_output_options(command, line.output);
  command.footer(fmt::format(
      "Examples:\n  kinescope contact log.csv --robot robot.urdf --learn free_motion.csv\n"
      "  kinescope contact log.csv --robot robot.urdf --model torque.json\n\n{}",
      kExitCodes));
}

}  // namespace kinescope
