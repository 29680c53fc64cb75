// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <cstdio>
#include <map>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/cli.h"
#include "app/commands/commands.h"
#include "app/commands/kept_observations.h"
#include "app/commands/limits.h"
#include "app/commands/run_again.h"
#include "app/explain/join_recordings.h"
#include "app/io/json_text.h"
#include "app/io/output_folder.h"
#include "app/io/sha256.h"
#include "app/report/fleet_summary.h"
#include "app/report/result_values.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kOutcome = "outcome.json";

// One robot's, as the list has it.
struct FleetEntry {
  std::string robot;
  std::vector<std::string> recordings;
};

// It names a folder.
bool is_plain_name(const std::string& name) {
  return !name.empty() && name.front() != '.' && std::ranges::all_of(name, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.';
  });
}

// By the robots' names.
std::vector<FleetEntry> read_fleet(const fs::path& path) {
  const CsvTable table = read_csv(path);
  const std::size_t robot = table.require_column("robot");
  const std::size_t recording = table.require_column("recording");
  std::map<std::string, std::vector<std::string>> robots;
  for (std::size_t k = 0; k < table.rows.size(); ++k) {
    const std::string& name = table.rows[k][robot];
    const std::string& folder = table.rows[k][recording];
    if (!is_plain_name(name)) {
      throw bad_input(table.place(k), fmt::format("'{}' is no name of a robot", name),
                      "names are of letters, digits, _, - and .: each is a folder");
    }
    if (folder.empty()) throw bad_input(table.place(k), "no recording is named", "name its folder");
    robots[name].push_back((path.parent_path() / folder).string());
  }
  if (robots.empty()) throw bad_input(path.string(), "it lists no robots", "write one a line");
  std::vector<FleetEntry> out;
  for (auto& [name, recordings] : robots) out.push_back({name, std::move(recordings)});
  return out;
}

std::vector<std::string> run_words(const FleetEntry& entry, const FleetOptions& options) {
  std::vector<std::string> words{"run"};
  words.insert(words.end(), entry.recordings.begin(), entry.recordings.end());
  words.insert(words.end(), options.run_words.begin(), options.run_words.end());
  words.push_back("--output=" + (options.output / entry.robot).string());
  return words;
}

// Nothing where the recordings cannot be read; the run will say why.
std::optional<std::vector<InputFile>> inputs_of_run(const std::vector<std::string>& words) {
  try {
    const RunOptions options = options_of_words({words, fs::current_path()}, kOutcome);
    return hash_inputs(described_together(read_recordings(options.recording, options.further)));
  } catch (const Error&) {
    return std::nullopt;
  }
}

// What the result depends on.
std::vector<std::string> without_threads(std::vector<std::string> words) {
  std::erase_if(words, [](const std::string& word) { return word.starts_with("--threads="); });
  return words;
}

json outcome_json(const FleetRobot& robot, const FleetOptions& options,
                  const std::optional<std::vector<InputFile>>& inputs) {
  return {{"schema", "kinescope.outcome"},
          {"schema_version", 1},
          {"version", program_version()},
          {"options", without_threads(options.run_words)},
          {"inputs", inputs ? report::inputs_json(*inputs) : json()},
          {"robot", fleet_robot_json(robot)}};
}

// Of the same recordings, options and version: here, or on another machine.
std::optional<FleetRobot> known_outcome(const fs::path& file, const json& asked) {
  std::error_code error;
  if (!fs::is_regular_file(file, error) || asked.at("inputs").is_null()) return std::nullopt;
  json kept = json::parse(read_text_file(file), nullptr, false);
  if (!kept.is_object()) return std::nullopt;
  for (const char* key : {"schema", "schema_version", "version", "options", "inputs"})
    if (kept.value(key, json()) != asked.at(key)) return std::nullopt;
  try {
    FleetRobot robot = fleet_robot_of(kept.at("robot"));
    // An answer is worth its files.
    const bool is_there = !has_answer(robot) || fs::exists(file.parent_path() / "run.json", error);
    return is_there ? std::optional(std::move(robot)) : std::nullopt;
  } catch (const json::exception&) {
    return std::nullopt;  // damaged: it is run once more
  }
}

// A robot that fails stops no other one.
FleetRobot run_robot(const FleetEntry& entry, const FleetOptions& options, const Console& console) {
  const std::vector<std::string> words = run_words(entry, options);
  const OutputFolder folder(
      options.output / entry.robot,
      {.command = "fleet", .products = {kOutcome}, .inputs = {}, .force = options.force});
  FleetRobot robot;
  robot.name = entry.robot;
  robot.recordings = entry.recordings;
  const auto inputs = inputs_of_run(words);
  if (!options.force) {
    const auto known = known_outcome(folder.file(kOutcome), outcome_json(robot, options, inputs));
    if (known) return *known;
  }
  std::vector<std::string> now = words;
  if (options.force) now.emplace_back("--force");
  const CalledCommand run = call_command(now, [&](std::string_view stage, int done, int total) {
    report_progress(console.progress, fmt::format("{}: {}", entry.robot, stage), done, total);
  });
  for (const std::string& warning : run.warnings)
    console.warn(fmt::format("{}: {}", entry.robot, warning));
  robot.exit_code = static_cast<int>(run.code);
  robot.reason = run.message;
  robot.warnings = static_cast<int>(run.warnings.size());
  // What led to no answer has numbers, too, and they are none of the robot.
  if (has_answer(robot)) take_result(json::parse(run.result, nullptr, false), robot);
  folder.write(kOutcome, json_text(outcome_json(robot, options, inputs)));
  return robot;
}

void print_fleet(const FleetSummary& summary, const FleetOptions& options, const Console& console) {
  if (console.json) {
    console.print(fleet_json(summary));
    return;
  }
  fmt::print("{}\n", fleet_verdict(summary));
  for (const std::string& line : fleet_lines(summary)) fmt::print("{}\n", line);
  if (options.shard) return;
  fmt::print("table   {}\npage    {}\n", (options.output / "fleet.csv").string(),
             (options.output / "fleet.html").string());
}

}  // namespace

ExitCode fleet_command(const FleetOptions& options, const Console& console) {
  static_cast<void>(parse_limits(options.fail_on));  // said once, before the long work
  const std::vector<FleetEntry> entries = read_fleet(options.table);
  require_apart(options.output, {options.table});
  const OutputFolder folder(options.output, {.command = "fleet",
                                             .products = {"fleet.json", "fleet.csv", "fleet.html"},
                                             .inputs = {},
                                             .force = options.force});
  FleetSummary summary{
      .version = program_version(),
      .command = options.command_line,
      .inputs = {{options.table.filename().string(), sha256_of_file(options.table)}},
      .robots = {}};
  const Shard shard = options.shard.value_or(Shard{});
  for (std::size_t k = 0; k < entries.size(); ++k)
    if (shard.holds(k)) summary.robots.push_back(run_robot(entries[k], options, console));
  report_progress(console.progress, "", 0, 0);
  summary.robots = worst_first(std::move(summary.robots));
  if (!options.shard) {
    folder.write({{"fleet.json", json_text(fleet_json(summary))},
                  {"fleet.csv", fleet_csv(summary)},
                  {"fleet.html", fleet_html(summary)}});
  }
  print_fleet(summary, options, console);
  // A shard is done when its robots were run; what they came to the table says.
  const bool any_failed = std::ranges::any_of(summary.robots, &FleetRobot::exit_code);
  if (options.shard || options.fail_on.empty() || !any_failed) return ExitCode::kDone;
  console.say_passed_limit(fleet_verdict(summary));
  return ExitCode::kOutsideLimits;
}

}  // namespace kinescope
