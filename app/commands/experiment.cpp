// SPDX-License-Identifier: Apache-2.0
//
// `kinescope experiment`: choices checked, the experiment run, its products written.
#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/commands.h"
#include "app/experiments/experiments.h"
#include "app/io/json_text.h"
#include "app/io/output_folder.h"
#include "app/torque/torque_inputs.h"
#include "dynamics/data/splits.h"
#include "dynamics/gp/process_group.h"
#include "kinematics/core/error.h"
#include "kinematics/recorded/recorded_log.h"

namespace kinescope {
namespace {

const Experiment& experiment_of(const std::string& name) {
  const auto found = std::ranges::find(all_experiments(), name, &Experiment::name);
  KINESCOPE_CHECK(found != all_experiments().end(), "the command line takes known names only");
  return *found;
}

// An option that would do nothing is refused.
void require_known(const Experiment& experiment, const ExperimentOptions& options) {
  const ExperimentChoice& choice = options.choice;
  const std::array<std::pair<std::string_view, bool>, 12> given = {
      {{"--runs", choice.runs.has_value()},
       {"--samples", choice.samples.has_value()},
       {"--seconds", choice.seconds.has_value()},
       {"--noise", choice.noise.has_value()},
       {"--tilt", choice.tilts_deg.has_value()},
       {"--shift", choice.shifts_m.has_value()},
       {"--inducing", choice.inducing.has_value()},
       {"--models", choice.learners.has_value()},
       {"--joints", choice.joints.has_value()},
       {"--starts", choice.starts.has_value()},
       {"--search-samples", choice.search_samples.has_value()},
       {"--log", !options.log.empty()}}};
  for (const auto& [name, is_given] : given) {
    if (!is_given) continue;
    if (std::ranges::find(experiment.options, name) == experiment.options.end()) {
      throw bad_request(std::string(name),
                        fmt::format("is no option of the experiment {}", experiment.name),
                        fmt::format("it takes {}", fmt::join(experiment.options, ", ")));
    }
    const bool of_worlds = name == "--noise" || name == "--tilt" || name == "--shift";
    if (of_worlds && !options.log.empty()) {
      throw bad_request(std::string(name), "is of the experiment's worlds, and there is a --log",
                        "leave one of them out");
    }
  }
  if (options.log.empty() != options.robot.empty()) {
    throw bad_request(options.log.empty() ? "--robot" : "--log",
                      options.log.empty() ? "a robot without its log" : "a log without its robot",
                      "give --log and --robot together");
  }
}

ExperimentLog read_log(const ExperimentOptions& options, const Console& console) {
  const TorqueRobot robot = read_torque_robot(options.robot, options.gravity_m_s2);
  std::vector<WantedJoint> wanted;
  for (const RigidBody& body : make_rigid_model(robot.model).bodies) {
    wanted.push_back({body.joint, body.type == JointType::kPrismatic});
  }
  TorqueData data =
      read_torque_data(recorded::read_channel_tables({options.log}), wanted, options.data);
  put_into_place({options.log}, data.findings);
  throw_refusals(data.findings);
  for (const LogFinding& finding : data.findings) {
    if (finding.weight == FaultWeight::kWarning) console.warn(to_line(finding));
  }
  return {robot.model, measured_part(data.samples), robot.joints};
}

void silence_output() {
  for (std::FILE* stream : {stdout, stderr}) {
    if (std::freopen("/dev/null", "w", stream) == nullptr) std::fclose(stream);
  }
}

// Of several processes all do the work, and the first one alone prints and writes.
bool one_of_the_others(const Experiment& experiment) {
  if (gp::process_count() > 1 &&
      std::ranges::find(experiment.options, "--models") == experiment.options.end()) {
    throw bad_request("mpirun",
                      fmt::format("the experiment {} is for one process", experiment.name),
                      "leave mpirun out");
  }
  return gp::process_rank() > 0;
}

}  // namespace

ExitCode experiment_command(const ExperimentOptions& options, const Console& console) {
  const Experiment& experiment = experiment_of(options.name);
  const gp::ProcessGroup processes;
  if (gp::process_rank() > 0) silence_output();
  require_known(experiment, options);
  const bool only_learns = one_of_the_others(experiment);
  Writer writer{.command = "experiment", .products = {}, .inputs = {}, .force = options.force};
  writer.products = {"experiment.json", "experiment.html"};
  for (const std::string_view table : experiment.tables) {
    writer.products.push_back(std::string(table) + ".csv");
  }
  ExperimentChoice choice = options.choice;
  std::vector<InputFile> inputs;
  if (!options.log.empty()) {
    writer.inputs = {options.log, options.robot};
    inputs = hashed_inputs({{options.log}, {options.robot}});
    choice.log = read_log(options, console);
  }
  if (only_learns) {
    static_cast<void>(experiment.run(choice, {}));
    return ExitCode::kDone;
  }
  const OutputFolder folder(options.output, writer);
  ExperimentSummary summary = experiment.run(choice, console.progress);
  summary.name = experiment.name;
  summary.title = experiment.title;
  summary.version = program_version();
  summary.command = options.command_line;
  summary.inputs = std::move(inputs);
  const nlohmann::json document = experiment_json(summary);
  std::vector<std::pair<std::string, std::string>> products{
      {"experiment.json", json_text(document)}, {"experiment.html", experiment_html(summary)}};
  for (const ExperimentTable& table : summary.tables)
    products.emplace_back(table.id + ".csv", experiment_csv(table));
  folder.write(products);
  if (console.json) {
    console.print(document);
    return ExitCode::kDone;
  }
  for (const std::string& finding : summary.findings) fmt::print("{}\n", finding);
  fmt::print("tables  {}\npage    {}\n", folder.file("experiment.json").string(),
             folder.file("experiment.html").string());
  return ExitCode::kDone;
}

}  // namespace kinescope
