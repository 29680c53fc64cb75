// SPDX-License-Identifier: Apache-2.0
//
// `kinescope policy`: a policy learned from few trials of a system, from one seed or several.
#include "app/commands/policy.h"

#include <fmt/format.h>

#include "app/commands/policy_search.h"
#include "app/commands/policy_seeds.h"
#include "app/io/json_text.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

Writer writer_of(const PolicyCommandOptions& options, std::vector<std::string> products) {
  Writer out{
      .command = "policy", .products = std::move(products), .inputs = {}, .force = options.force};
  std::error_code error;
  if (fs::exists(options.system, error)) out.inputs.emplace_back(options.system);
  return out;
}

ExitCode one_seed(const PolicyCommandOptions& options, const Console& console) {
  const PolicyRequest request = make_policy_request(options);
  const policy::LearnerOptions& learner = request.problem.learner;
  const OutputFolder folder(
      options.output, writer_of(options, policy_products(learner.explorations + learner.trials)));
  PolicySearch search(request, options, folder);
  search.open(options.force);
  search.run(console);
  if (console.json) {
    console.print(policy_search_json(search.summary()));
    return ExitCode::kDone;
  }
  for (const std::string& finding : policy_findings(search.summary())) fmt::print("{}\n", finding);
  fmt::print("policy  {}\npage    {}\n", folder.file("policy.json").string(),
             folder.file("policy.html").string());
  return ExitCode::kDone;
}

// The table of all seeds that are there.
ExperimentSummary write_table(const OutputFolder& folder, const PolicyCommandOptions& options,
                              const PolicyRequest& request) {
  ExperimentSummary out =
      policy_seeds_summary(options.output, request.fingerprint, request.problem.name);
  out.version = program_version();
  out.command = options.command_line;
  out.inputs = request.inputs;
  for (const ExperimentTable& table : out.tables) {
    folder.write(table.id + ".csv", experiment_csv(table));
  }
  folder.write("experiment.json", json_text(experiment_json(out)));
  folder.write("experiment.html", experiment_html(out));
  return out;
}

ExitCode several_seeds(const PolicyCommandOptions& options, const Console& console) {
  const PolicyRequest common = make_policy_request(options);
  const auto [first, last] = value_of(options.seeds);
  const OutputFolder folder(
      options.output,
      writer_of(options, {"experiment.json", "experiment.html", "success.csv", "seeds.csv"}));
  ExperimentSummary summary;
  for (int seed = first; seed <= last; ++seed) {
    PolicyCommandOptions one = options;
    one.seed = static_cast<std::uint64_t>(seed);
    one.output = options.output / seed_folder_name(one.seed);
    const PolicyRequest request = make_policy_request(one);
    const policy::LearnerOptions& learner = request.problem.learner;
    const OutputFolder own(one.output,
                           writer_of(one, policy_products(learner.explorations + learner.trials)));
    PolicySearch search(request, one, own);
    search.open(options.force);
    Console with_seed = console;
    with_seed.progress = [&](std::string_view stage, int done, int total) {
      report_progress(console.progress,
                      stage.empty() ? "" : fmt::format("seed {}, {}", seed, stage), done, total);
    };
    search.run(with_seed);
    summary = write_table(folder, options, common);
  }
  if (console.json) {
    console.print(experiment_json(summary));
    return ExitCode::kDone;
  }
  for (const std::string& finding : summary.findings) fmt::print("{}\n", finding);
  fmt::print("tables  {}\npage    {}\n", folder.file("experiment.json").string(),
             folder.file("experiment.html").string());
  return ExitCode::kDone;
}

}  // namespace

ExitCode policy_command(const PolicyCommandOptions& options, const Console& console) {
  return options.seeds ? several_seeds(options, console) : one_seed(options, console);
}

}  // namespace kinescope
