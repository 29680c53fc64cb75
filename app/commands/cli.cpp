// SPDX-License-Identifier: Apache-2.0
#include "app/commands/cli.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iostream>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/command_line.h"
#include "app/commands/command_options.h"
#include "app/commands/progress_line.h"
#include "app/commands/run_again.h"
#include "app/commands/shell_line.h"
#include "app/io/nearest_name.h"
#include "app/torque/saved_model_log.h"
#include "kinematics/core/blas_kernels.h"
#include "kinematics/core/single_threaded_blas.h"
#include "kinematics/recorded/container.h"

namespace kinescope {
namespace {

/// One line, whatever the library wrote.
std::string in_one_line(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::ranges::replace(text, '\n', ' ');
  return text;
}

void print_error(const std::string& message) {
  // fmt throws where standard error is closed.
  std::fputs(fmt::format("kinescope: {}\n", in_one_line(message)).c_str(), stderr);
}

/// Names of the subcommands, or of a subcommand's options.
std::vector<std::string> known_words(const CLI::App& app, const CLI::App* command) {
  std::vector<std::string> words;
  if (command == nullptr) {
    for (const CLI::App* sub : app.get_subcommands({})) words.push_back(sub->get_name());
    return words;
  }
  for (const CLI::Option* option : command->get_options()) {
    for (const std::string& name : option->get_lnames()) words.push_back("--" + name);
  }
  return words;
}

/// What CLI11 found wrong, with the nearest word that it would have taken.
std::string parse_error_words(const CLI::App& app, const CLI::ParseError& error, int argc,
                              const char* const* argv) {
  const std::vector<CLI::App*> chosen = app.get_subcommands();
  const CLI::App* command = chosen.empty() ? nullptr : chosen.front();
  std::string remedy = command == nullptr
                           ? "see kinescope --help"
                           : fmt::format("see kinescope {} --help", command->get_name());
  std::string message = error.what();
  if (command == nullptr && argc > 1 && argv[1][0] != '-') {
    message = fmt::format("'{}' is no command", argv[1]);
    remedy = did_you_mean(argv[1], known_words(app, nullptr));
  } else if (command == nullptr) {
    message = "name a command";
    remedy =
        "run, merge, fleet, trace, correct, compare, plan, dynamics, predict, simulate, control, "
        "export, "
        "contact, "
        "experiment, "
        "policy, inspect, camera, markers or capture; see kinescope --help";
  } else {
    const std::vector<std::string> extra = command->remaining();
    const auto option =
        std::ranges::find_if(extra, [](const std::string& word) { return word.starts_with("--"); });
    if (option != extra.end()) {
      message = fmt::format("{} is no option of {}", *option, command->get_name());
      remedy = did_you_mean(*option, known_words(app, command));
    }
  }
  return fmt::format("{} ({})", in_one_line(message), remedy);
}

// "log" of "folder/log.csv.gz".
std::string log_name(const std::filesystem::path& log) {
  const auto container = recorded::container_of(log);
  const std::string name = (container ? container->path : log).filename().string();
  return name.substr(0, name.find('.'));
}

// The run of a run folder once more, tracing, from its own command line.
ExitCode run_again(const CommandLine& line, const Console& console) {
  const std::filesystem::path& folder = line.trace.run_folder;
  RunOptions options = options_of_run(folder);
  options.trace = true;
  options.must_trace = true;
  options.force = false;  // detection is taken from the folder, and others' files stay
  options.command_line = "kinescope trace " + folder.string();
  return run_command(options, console);
}

// What all shards of a run have in common.
std::vector<std::string> words_of_all_shards(const CLI::App& run) {
  return words_of(run, {"--shard", "--output", "--threads", "--force", "--json", "--quiet"});
}

// Options of a fleet that are those of each of its runs.
std::vector<std::string> words_of_all_robots(const CLI::App& fleet) {
  std::vector<std::string> words =
      words_of(fleet, {"--shard", "--output", "--force", "--json", "--quiet"});
  words.erase(words.begin(), words.begin() + 2);  // its name, and the list of robots
  return words;
}

ExitCode run_parsed(const CLI::App& app, CommandLine& line, const Console& console) {
  if (app.got_subcommand("run")) {
    RunOptions options = finished_options(line);
    if (options.shard) options.arguments = words_of_all_shards(*app.get_subcommand("run"));
    return run_command(options, console);
  }
  if (app.got_subcommand("merge")) return run_command(options_of_merge(line.merge), console);
  if (app.got_subcommand("fleet")) {
    FleetOptions& fleet = line.fleet;
    if (fleet.output.empty()) fleet.output = log_name(fleet.table) + "_fleet";
    fleet.run_words = words_of_all_robots(*app.get_subcommand("fleet"));
    fleet.fail_on = line.run.fail_on;
    return fleet_command(fleet, console);
  }
  if (app.got_subcommand("trace")) return run_again(line, console);
  if (app.got_subcommand("correct")) return correct_command(line.correct, console);
  if (app.got_subcommand("compare")) return compare_command(line.compare, console);
  if (app.got_subcommand("plan")) {
    if (line.plan.output.empty()) line.plan.output = recording_name(line.plan.source) + "_plan";
    return plan_command(line.plan, console);
  }
  if (app.got_subcommand("dynamics")) {
    if (line.dynamics.output.empty()) {
      line.dynamics.output = log_name(line.dynamics.logs.front()) + "_dynamics";
    }
    line.dynamics.data =
        log_settings(line.settings, line.dynamics.logs.front(), line.dynamics.data);
    return dynamics_command(line.dynamics, console);
  }
  if (app.got_subcommand("predict")) {
    if (line.predict.output.empty()) {
      line.predict.output = log_name(line.predict.logs.front()) + "_predicted.csv";
    }
    line.predict.data = log_settings(line.settings, line.predict.logs.front(), line.predict.data);
    return predict_command(line.predict, console);
  }
  if (app.got_subcommand("simulate")) return simulate_command(line.simulate, console);
  if (app.got_subcommand("control")) {
    if (line.control.output.empty()) {
      line.control.output = log_name(line.control.trajectory) + "_control";
    }
    return control_command(line.control, console);
  }
  if (app.got_subcommand("export")) return export_command(line.exported, console);
  if (app.got_subcommand("contact")) {
    if (line.contact.output.empty()) {
      line.contact.output = log_name(line.contact.logs.front()) + "_contact";
    }
    line.contact.data = log_settings(line.settings, line.contact.logs.front(), line.contact.data);
    return contact_command(line.contact, console);
  }
  if (app.got_subcommand("experiment")) {
    ExperimentOptions& experiment = line.experiment;
    if (experiment.output.empty()) experiment.output = experiment.name + "_experiment";
    if (!experiment.log.empty())
      experiment.data = log_settings(line.settings, experiment.log, experiment.data);
    return experiment_command(experiment, console);
  }
  if (app.got_subcommand("policy")) {
    PolicyCommandOptions& policy = line.policy;
    if (policy.output.empty()) policy.output = log_name(policy.system) + "_policy";
    return policy_command(policy, console);
  }
  if (app.got_subcommand("inspect")) {
    const std::filesystem::path& log = line.inspect.recording.folder;
    if (std::filesystem::is_regular_file(log) || recorded::container_of(log))
      line.inspect.data =
          log_settings(line.settings, line.inspect.recording.folder, line.inspect.data);
    return inspect_command(line.inspect, console);
  }
  if (app.got_subcommand("capture")) return capture_command(line.capture, console);
  if (app.got_subcommand("markers")) return markers_command(line.markers, console);
  return camera_command(line.camera, console);
}

struct Outcome {
  ExitCode code = ExitCode::kInternalError;
  std::string message;  ///< of what was thrown
};

/// What is empty was a variable of the shell that is not set.
void require_words(const CLI::App& app) {
  for (const CLI::App* command : app.get_subcommands()) {
    for (const CLI::Option* option : command->get_options()) {
      if (std::ranges::count(option->results(), std::string()) > 0)
        throw bad_request(option->get_name(), "is empty", "name something, or leave it out");
    }
  }
}

/// All that is thrown ends here.
Outcome run_guarded(const CLI::App& app, CommandLine& line, const Console& console) {
  Outcome out;
  try {
    require_words(app);
    out.code = run_parsed(app, line, console);
  } catch (const Error& error) {
    out.code = error.code();
    out.message = error.what();
  } catch (const std::filesystem::filesystem_error& error) {
    out.code = ExitCode::kBadRequest;
    out.message = fmt::format(
        "{}: cannot be reached: {} (check the path, and that the current "
        "folder is still there)",
        error.path1().empty() ? "." : error.path1().string(), error.code().message());
  } catch (const std::bad_alloc&) {
    out.message = "out of memory (a shorter video, or a machine with more of it)";
  } catch (const std::exception& error) {
    // fmt throws where standard output cannot be written; after_output() tells that.
    if (std::ferror(stdout) == 0)
      out.message =
          fmt::format("internal error: {} (please report it with the command line)", error.what());
  } catch (...) {
    out.message = "internal error of unknown kind (please report it with the command line)";
  }
  return out;
}

/// The command on the terminal, with its progress.
int run_in_terminal(const CLI::App& app, CommandLine& line) {
  ProgressLine progress = ProgressLine::for_standard_error();
  Console console{.json = line.output.json, .quiet = line.output.quiet};
  if (!console.quiet) {
    console.progress = [&progress](std::string_view stage, int done, int total) {
      progress.update(stage, done, total);
    };
  }
  const Outcome outcome = run_guarded(app, line, console);
  progress.finish();
  if (!outcome.message.empty()) print_error(outcome.message);
  return static_cast<int>(outcome.code);
}

/// The exit code, unless what was printed did not arrive (a full disk, a closed output).
int after_output(int code) {
  const bool written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.flush();
  const bool failed_otherwise = code == static_cast<int>(ExitCode::kBadRequest) ||
                                code == static_cast<int>(ExitCode::kBadInput) ||
                                code == static_cast<int>(ExitCode::kUndetermined);
  if (written || failed_otherwise) return code;
  print_error("standard output: cannot be written (free some space, or write to another place)");
  return static_cast<int>(ExitCode::kBadRequest);
}

/// A first word that is no command is said to be none, also before --help.
bool names_no_command(const CLI::App& app, int argc, const char* const* argv) {
  return argc > 1 && argv[1][0] != '-' && app.get_subcommands().empty();
}

/// A command line with what reports say of it, and its options.
void begin_line(CLI::App& app, CommandLine& line, int argc, const char* const* argv) {
  line.run.arguments.assign(argv + 1, argv + argc);
  line.run.command_line = shell_line(line.run.arguments);
  line.dynamics.command_line = line.run.command_line;
  line.contact.command_line = line.run.command_line;
  line.experiment.command_line = line.run.command_line;
  line.policy.command_line = line.run.command_line;
  line.control.command_line = line.run.command_line;
  line.compare.command_line = line.run.command_line;
  line.plan.command_line = line.run.command_line;
  line.merge.command_line = line.run.command_line;
  line.fleet.command_line = line.run.command_line;
  add_commands(app, line);
}

}  // namespace

void prepare_process(char** argv) {
  take_better_blas_kernels(argv);
  static_cast<void>(std::signal(SIGXFSZ, SIG_IGN));
}

int run_program(int argc, const char* const* argv) {
  const SingleThreadedBlas same_bytes_on_any_number_of_cores;
  CLI::App app;
  CommandLine line;
  begin_line(app, line, argc, argv);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const bool asked = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success);
    if (asked && !names_no_command(app, argc, argv)) return after_output(app.exit(error));
    print_error(parse_error_words(app, error, argc, argv));
    return static_cast<int>(ExitCode::kBadRequest);
  }
  return after_output(run_in_terminal(app, line));
}

CalledCommand call_command(const std::vector<std::string>& arguments, const Progress& progress) {
  const SingleThreadedBlas same_bytes_on_any_number_of_cores;
  std::vector<const char*> argv{"kinescope"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  const int argc = static_cast<int>(argv.size());
  CLI::App app;
  CommandLine line;
  begin_line(app, line, argc, argv.data());
  try {
    app.parse(argc, argv.data());
  } catch (const CLI::ParseError& error) {
    return {.code = ExitCode::kBadRequest,
            .message = parse_error_words(app, error, argc, argv.data())};
  }
  CalledCommand out;
  std::vector<std::string> passed;
  const Console console{
      .json = true,
      .quiet = true,
      .progress = progress,
      .result = [&out](const std::string& text) { out.result = text; },
      .warning = [&out](const std::string& text) { out.warnings.push_back(text); },
      .passed_limit = [&passed](const std::string& text) { passed.push_back(text); }};
  Outcome outcome = run_guarded(app, line, console);
  out.code = outcome.code;
  out.message = in_one_line(std::move(outcome.message));
  if (out.message.empty() && !passed.empty())
    out.message = fmt::format("outside the limit {}", fmt::join(passed, "; "));
  return out;
}

}  // namespace kinescope
