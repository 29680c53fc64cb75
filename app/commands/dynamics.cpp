// SPDX-License-Identifier: Apache-2.0
//
// `kinescope dynamics`: model_torque() in words.
#include <cmath>

#include <fmt/format.h>

#include "app/commands/commands.h"
#include "app/report/trace_lines.h"
#include "app/torque/model_torque.h"
#include "app/torque/torque_inputs.h"

namespace kinescope {
namespace {

void print_scores(const TorqueSummary& summary) {
  fmt::print("nMSE on {}, %\n{:<16} {:>8} {:>8}", summary.split, "model", "samples", "inducing");
  for (const std::string& joint : summary.joints) fmt::print(" {:>10}", joint);
  fmt::print("\n");
  for (const TorqueScore& score : summary.scores) {
    if (!score.failure.empty()) {
      fmt::print("{:<16} {}\n", name_of(score), score.failure);
      continue;
    }
    fmt::print("{:<16} {:>8} {:>8}", name_of(score), score.training_samples,
               score.inducing_points > 0 ? fmt::format("{}", score.inducing_points) : "-");
    for (const double nmse : score.nmse_percent) {
      fmt::print(" {:>10}", std::isfinite(nmse) ? fmt::format("{:.3g}", nmse) : "-");
    }
    fmt::print("\n");
  }
  for (const std::string& note : model_notes(summary)) fmt::print("{}\n", note);
}

}  // namespace

ExitCode dynamics_command(const DynamicsOptions& options, const Console& console) {
  const TorqueSummary summary = model_torque(options, console.progress);
  for (const std::string& warning : summary.warnings) console.warn(warning);
  for (const std::string& warning : warnings_of(summary.data.findings)) console.warn(warning);
  if (console.json) {
    console.print(torque_json(summary));
    return ExitCode::kDone;
  }
  const TorqueVerdict verdict = torque_verdict(summary);
  fmt::print("{}\n{}\n{}\n", verdict.found, verdict.accurate, verdict.limits);
  if (!verdict.payload.empty()) fmt::print("{}\n", verdict.payload);
  if (!verdict.gravity.empty()) fmt::print("{}\n", verdict.gravity);
  if (!verdict.rollout.empty()) fmt::print("{}\n", verdict.rollout);
  print_scores(summary);
  if (summary.trace) {
    for (const std::string& line : trace_lines(*summary.trace)) fmt::print("{}\n", line);
  }
  fmt::print("urdf    {}\n", (options.output / "robot_dynamics.urdf").string());
  if (summary.has_traced_robot) {
    fmt::print("traced  {} (with what tracing found; contacts left out)\n",
               (options.output / "robot_traced.urdf").string());
  }
  if (!options.save_model.empty()) {
    fmt::print("model   {} ({}; for kinescope predict)\n", options.save_model.string(),
               summary.saved_model);
  }
  fmt::print("report  {}\n", (options.output / "dynamics.html").string());
  return ExitCode::kDone;
}

}  // namespace kinescope
