// SPDX-License-Identifier: Apache-2.0
#include "app/commands/experiment_command_line.h"

#include <fmt/format.h>

#include "app/commands/command_options.h"
#include "app/commands/torque_command_line.h"
#include "app/experiments/experiments.h"

namespace kinescope {
namespace {

constexpr const char* kWhat = "What is done (default: the experiment's own)";

std::vector<std::string> experiment_names() {
  std::vector<std::string> out;
  for (const Experiment& experiment : all_experiments()) out.emplace_back(experiment.name);
  return out;
}

std::vector<std::string> learner_names() {
  std::vector<std::string> out;
  for (const std::string_view name : experiments::learner_names()) out.emplace_back(name);
  return out;
}

void add_count(CLI::App& command, const char* name, std::optional<int>& value, double least,
               double most, const char* help) {
  command.add_option_function<int>(
             name, [&value](const int& count) { value = count; }, help)
      ->check(number_in(least, most))
      ->type_name("N")
      ->group(kWhat);
}

void add_list(CLI::App& command, const char* name, std::optional<std::vector<double>>& values,
              double least, double most, const char* help) {
  command
      .add_option_function<std::vector<double>>(
          name, [&values](const std::vector<double>& list) { values = list; }, help)
      ->delimiter(',')
      ->check(number_in(least, most))
      ->type_name("LIST")
      ->group(kWhat);
}

void add_choices(CLI::App& command, ExperimentChoice& choice) {
  add_count(command, "--runs", choice.runs, 1, 10000,
            "Random worlds; of a log, parts that are left out one after another");
  add_count(command, "--samples", choice.samples, 50, 1e6, "Samples to learn from");
  add_count(command, "--inducing", choice.inducing, 10, 10000,
            "Inducing points of the models that have them");
  command
      .add_option_function<double>(
          "--seconds", [&choice](const double& seconds) { choice.seconds = seconds; },
          "Of each simulated log")
      ->check(number_in(5, 3600))
      ->type_name("S")
      ->group(kWhat);
  command
      .add_option_function<double>(
          "--noise", [&choice](const double& noise) { choice.noise = noise; },
          "Of the torques, share of their spread")
      ->check(number_in(0, 1))
      ->type_name("SHARE")
      ->group(kWhat);
  add_list(command, "--tilt", choice.tilts_deg, 0.01, 45, "Misplaced joints: tilts, degrees");
  add_list(command, "--shift", choice.shifts_m, 0, 1, "The shift that goes with each tilt, m");
  command
      .add_option_function<std::vector<std::string>>(
          "--models",
          [&choice](const std::vector<std::string>& words) {
            choice.learners.emplace();
            for (const std::string& word : words)
              choice.learners->push_back(*experiments::learner_of(word));
          },
          "Some of gip, rbf, network, semi_parametric, model_based, parametric, lip (slow), "
          "gip_inducing, rbf_inducing, semi_parametric_inducing")
      ->delimiter(',')
      ->check(one_of(learner_names()))
      ->type_name("LIST")
      ->group(kWhat);
  command
      .add_option_function<std::vector<int>>(
          "--joints", [&choice](const std::vector<int>& joints) { choice.joints = joints; },
          "Joints of the arm, counted from its base; several numbers: one after another")
      ->delimiter(',')
      ->check(number_in(2, 7))
      ->type_name("LIST")
      ->group(kWhat);
  add_count(command, "--starts", choice.starts, 1, 100,
            "Of every search of hyperparameters; the best one counts");
  add_count(command, "--search-samples", choice.search_samples, 50, 40000,
            "Samples that each search sees");
}

}  // namespace

void add_experiment(CLI::App& app, CommandLine& line) {
  CLI::App& command = *app.add_subcommand(
      "experiment", "The experiments of the literature, as tables and a page with figures");
  ExperimentOptions& experiment = line.experiment;
  std::string help = "Which one:";
  for (const Experiment& one : all_experiments()) {
    help += fmt::format("{} {} ({})", help.back() == ':' ? "" : ",", one.name, one.title);
  }
  command
      .add_option_function<std::string>(
          "NAME", [&experiment](const std::string& text) { experiment.name = text; }, help)
      ->required()
      ->check(one_of(experiment_names()))
      ->type_name("NAME");
  add_choices(command, experiment.choice);
  command.add_option("--seed", experiment.choice.seed, "Of all random numbers")
      ->check(number_in(0, 1e9))
      ->capture_default_str()
      ->type_name("N");
  add_threads(command, experiment.choice.threads);
  command
      .add_option_function<std::string>(
          "--log", [&experiment](const std::string& text) { experiment.log = text; },
          "A log with torques in place of the experiment's worlds: CSV, also gzipped")
      ->type_name("FILE");
  command
      .add_option_function<std::string>(
          "--robot", [&experiment](const std::string& text) { experiment.robot = text; },
          "The log's robot (URDF)")
      ->type_name("FILE");
  add_gravity(command, experiment.gravity_m_s2);
  add_log_options(command, line, experiment.data);
  add_cutoff(command, experiment.data);
  command
      .add_option_function<std::string>(
          "-o,--output", [&experiment](const std::string& text) { experiment.output = text; },
          "Folder for the results (default: <name>_experiment here)")
      ->type_name("FOLDER");
  add_force(command, experiment.force, kReplaceOthers);
  add_output_options(command, line.output);
  command.footer(fmt::format(
      "Examples:\n  kinescope experiment scara --runs 2 --samples 500 --tilt 2 --shift 0.01\n"
      "  kinescope experiment ur10 --samples 40000\n"
      "  kinescope experiment efficiency --log log.csv --robot robot.urdf\n\n{}",
      kExitCodes));
}

}  // namespace kinescope
