// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "app/commands/carry_over.h"
#include "app/commands/commands.h"
#include "app/commands/compared_runs.h"
#include "app/io/json_text.h"
#include "app/io/output_folder.h"
#include "app/io/same_place.h"
#include "app/report/compare_summary.h"
#include "app/torque/torque_inputs.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

void require_several(const std::vector<fs::path>& runs) {
  if (runs.size() < 2) {
    throw bad_request("compare", "one run cannot be compared",
                      "give the folders of two runs or more");
  }
  for (std::size_t a = 0; a < runs.size(); ++a) {
    for (std::size_t b = a + 1; b < runs.size(); ++b) {
      if (!same_place(runs[a], runs[b])) continue;
      throw bad_request(runs[b].string(), "is given twice", "give folders of different runs");
    }
  }
}

ComparedRun compared_run(const StoredRun& run) {
  const Calibration& calibration = run.calibration;
  return {.name = run.name,
          .robot = calibration.tree.name,
          .recording = run.recording,
          .held_out_rms = calibration.held_out_rms,
          .rms_unit = calibration.kind == MeasurementKind::kCorners ? "px" : "m",
          .time_offset_s = calibration.time_offset_s,
          .time_offset_sigma_s = calibration.time_offset_sigma_s};
}

// The first run's model on every other one's recording, and the other way round.
std::vector<CarriedOver> carried_over(const std::vector<StoredRun>& runs,
                                      const std::vector<RobotMatch>& matches, double level,
                                      const Progress& progress) {
  std::vector<CarriedOver> out;
  const int total = 2 * (static_cast<int>(runs.size()) - 1);
  for (std::size_t k = 1; k < runs.size(); ++k) {
    for (const auto& [model, onto] : {std::pair{std::size_t{0}, k}, std::pair{k, std::size_t{0}}}) {
      report_progress(progress, "carry over", static_cast<int>(out.size()), total);
      CarriedOver one;
      if (matches[k].differences.empty()) {
        one = carry_over(runs[model], runs[onto],
                         match_robots(runs[model].calibration.tree, runs[onto].calibration.tree),
                         level);
      } else {
        one.skipped = "the structures differ";
      }
      one.model = model;
      one.recording = onto;
      out.push_back(std::move(one));
    }
  }
  report_progress(progress, "", 0, 0);
  return out;
}

bool could_not_compare(const CompareSummary& summary) {
  return std::ranges::any_of(summary.differences, [](const RunDifference& one) {
    return std::ranges::none_of(one.quantities, [](const auto& q) { return q.sigma.has_value(); });
  });
}

bool could_not_try(const CompareSummary& summary) {
  return std::ranges::any_of(summary.carried,
                             [](const CarriedOver& one) { return !one.skipped.empty(); });
}

// What is not known is not within a limit, as of `run`.
ExitCode within_limit(const CompareSummary& summary, CompareLimit limit, const Console& console) {
  const bool change = limit == CompareLimit::kChange || limit == CompareLimit::kAny;
  const bool carry = limit == CompareLimit::kCarry || limit == CompareLimit::kAny;
  bool within = true;
  const auto fail = [&](const std::string& what) {
    console.say_passed_limit(what);
    within = false;
  };
  if (change && anything_changed(summary)) fail("change: the robot differs");
  if (change && !anything_changed(summary) && could_not_compare(summary))
    fail("change: nothing could be compared");
  if (carry && anything_fails_to_carry(summary)) fail("carry: a model does not carry over");
  if (carry && could_not_try(summary)) fail("carry: a model could not be tried");
  return within ? ExitCode::kDone : ExitCode::kOutsideLimits;
}

// Before the work; none where the comparison is only printed.
std::optional<OutputFolder> output_of(const CompareOptions& options) {
  if (options.output.empty()) return std::nullopt;
  return OutputFolder(options.output, {.command = "compare",
                                       .products = {"compare.json", "compare.html"},
                                       .inputs = {},
                                       .force = options.force});
}

std::vector<fs::path> input_files(const std::vector<fs::path>& runs) {
  std::vector<fs::path> out;
  for (const fs::path& run : runs) out.push_back(run / "calibration.json");
  return out;
}

void print_comparison(const CompareSummary& summary, const CompareOptions& options,
                      const Console& console) {
  if (console.json) {
    console.print(compare_json(summary));
    return;
  }
  fmt::print("{}\n", compare_verdict(summary));
  for (const std::string& finding : compare_findings(summary)) fmt::print("{}\n", finding);
  if (options.output.empty()) return;
  fmt::print("numbers {}\npage    {}\n", (options.output / "compare.json").string(),
             (options.output / "compare.html").string());
}

}  // namespace

ExitCode compare_command(const CompareOptions& options, const Console& console) {
  require_several(options.runs);
  const std::vector<fs::path> inputs = input_files(options.runs);
  if (!options.output.empty()) require_apart(options.output, inputs);
  std::vector<StoredRun> runs;
  for (const fs::path& folder : options.runs) runs.push_back(read_stored_run(folder));
  const std::vector<RobotMatch> matches = match_runs(runs);
  const std::optional<OutputFolder> folder = output_of(options);

  CompareSummary summary;
  summary.version = program_version();
  summary.command = options.command_line;
  summary.inputs = hashed_inputs({inputs});
  summary.level = options.level;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    summary.inputs[k].name = (fs::path(runs[k].name) / "calibration.json").string();
    summary.runs.push_back(compared_run(runs[k]));
  }
  summary.differences = run_differences(runs, matches, options.level);
  summary.carried = carried_over(runs, matches, options.level, console.progress);
  if (folder) {
    folder->write({{"compare.json", json_text(compare_json(summary))},
                   {"compare.html", compare_html(summary)}});
  }
  print_comparison(summary, options, console);
  return within_limit(summary, options.fail_on, console);
}

}  // namespace kinescope
