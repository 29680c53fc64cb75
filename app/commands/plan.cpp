// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>

#include <fmt/format.h>

#include "app/commands/commands.h"
#include "app/commands/planned_run.h"
#include "app/io/json_text.h"
#include "app/io/output_folder.h"
#include "app/report/plan_summary.h"
#include "app/torque/torque_inputs.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

constexpr double kUsualSeconds = 20.0;
constexpr int kUsualPostures = 20;
constexpr double kCommandRate_hz = 100.0;  // rows of plan.csv of a motion

design::PlanOptions design_options(const PlanCommandOptions& options, const PlannedRun& run) {
  design::PlanOptions out;
  out.goal = options.goal;
  out.seed = options.seed;
  out.frame_rate_hz = run.frame_rate_hz;
  const bool postures = options.postures || (!options.seconds && run.of_postures);
  if (postures) {
    out.postures = options.postures.value_or(kUsualPostures);
    return out;
  }
  out.seconds = options.seconds.value_or(kUsualSeconds);
  if (!run.speeds_known) {
    throw bad_request(options.source.string(),
                      "how fast the joints may move is not known: " + run.speeds_unknown,
                      "plan postures at rest (--postures N), or put the recording where it was");
  }
  if (!(run.frame_rate_hz > 0.0)) {
    throw bad_request(options.source.string(), "the rate of the camera is not known",
                      "give it with --rate");
  }
  return out;
}

// In the units that the recording's log was written in.
std::string plan_csv(const PlannedRun& run, const design::RecordingPlan& plan) {
  std::string out = "t";
  std::vector<double> factors;
  for (const std::string& channel : run.space.channels()) {
    const auto factor = run.unit_factors.find(channel);
    factors.push_back(factor == run.unit_factors.end() ? 1.0 : factor->second);
    out += "," + channel;
  }
  const auto add = [&](double time_s, const Eigen::VectorXd& readings) {
    out += fmt::format("\n{:.3f}", time_s);
    for (std::size_t c = 0; c < factors.size(); ++c)
      out += fmt::format(",{:.12g}", readings[static_cast<Eigen::Index>(c)] / factors[c]);
  };
  if (plan.path) {
    constexpr double kRounding = 1e-6;  // rows: of a duration that is a sum
    const auto rows =
        static_cast<int>(std::ceil(plan.path->duration_s() * kCommandRate_hz - kRounding));
    for (int i = 0; i <= rows; ++i)
      add(i / kCommandRate_hz, plan.path->readings(i / kCommandRate_hz));
  } else {
    for (std::size_t i = 0; i < plan.postures.size(); ++i)
      add(static_cast<double>(i), plan.postures[i]);
  }
  return out + "\n";
}

// Of those among the axes, where they are; a single axis is known in the base alone.
PlannedAxis planned_axis(const JointEstimate& joint) {
  if (joint.among_direction_sigma_rad)
    return {joint.among_direction_sigma_rad, joint.among_position_sigma_m};
  return {joint.direction_sigma_rad, joint.position_sigma_m};
}

std::vector<PlannedJoint> planned_joints(const PlannedRun& run, const design::RecordingPlan& plan) {
  std::vector<PlannedJoint> out;
  const KinematicTree& tree = run.space.tree();
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    if (joint.type == JointType::kFixed) continue;
    PlannedJoint& one = out.emplace_back();
    one.name = joint.name;
    one.channel = joint.channel;
    one.type = joint.type;
    one.allowed = run.space.limits().range[j];
    one.recorded = run.robot.calibration.joints[j].range;
    one.before = planned_axis(plan.before.axes[j]);
    one.after = planned_axis(plan.after.axes[j]);
    std::vector<double> values;
    for (const Eigen::VectorXd& readings : plan.postures)
      values.push_back(run.space.values(readings)[static_cast<Eigen::Index>(j)]);
    one.planned = {std::ranges::min(values), std::ranges::max(values)};
  }
  return out;
}

std::string effect_words(const EffectId& id) { return id.effect + " of " + id.place; }

PlanSummary plan_summary_of(const PlanCommandOptions& options, const PlannedRun& run,
                            const design::PlanOptions& asked, const design::RecordingPlan& plan) {
  PlanSummary out;
  out.version = program_version();
  out.command = options.command_line;
  out.inputs = hashed_inputs({{options.source / "calibration.json"}});
  out.source = options.source.string();
  out.robot = run.robot.calibration.tree.name;
  out.goal = asked.goal == design::Goal::kTip ? "tip" : "axes";
  out.seconds = asked.seconds;
  out.rate_hz = asked.seconds > 0.0 ? asked.frame_rate_hz : 0.0;
  out.postures = static_cast<int>(plan.postures.size());
  out.frames = plan.frames;
  out.noise_px = run.robot.noise.all_px;
  out.before_m = plan.before.goal_m;
  out.after_m = plan.after.goal_m;
  out.joints = planned_joints(run, plan);
  for (const design::RivalPromise& pair : plan.rivals)
    out.rivals.push_back(
        {effect_words(pair.believed), effect_words(pair.other), pair.sigmas_apart});
  for (const auto& [id, frames] : plan.sightings) out.markers.push_back({id.value, frames});
  out.seen_share = plan.seen_share;
  out.warnings = run.warnings;
  return out;
}

void print_plan(const PlanSummary& summary, const OutputFolder& folder, const Console& console) {
  if (console.json) {
    console.print(plan_json(summary));
    return;
  }
  fmt::print("{}\n", plan_verdict(summary));
  for (const std::string& finding : plan_findings(summary)) fmt::print("{}\n", finding);
  fmt::print("motion  {}\nnumbers {}\n", folder.file("plan.csv").string(),
             folder.file("plan.json").string());
}

}  // namespace

ExitCode plan_command(const PlanCommandOptions& options, const Console& console) {
  if (options.postures && options.seconds) {
    throw bad_request("--postures", "a plan is of postures or of a motion",
                      "leave out --postures or --seconds");
  }
  const PlannedRun run = read_planned_run(options);
  constexpr double kMostFrames = 1e5;
  if (options.seconds.value_or(0.0) * run.frame_rate_hz > kMostFrames) {
    throw bad_request("--seconds",
                      fmt::format("{:g} s at {:g} frames/s are more than {:g} frames",
                                  *options.seconds, run.frame_rate_hz, kMostFrames),
                      "give less --seconds, or a lower --rate");
  }
  for (const std::string& warning : run.warnings) console.warn(warning);
  const design::PlanOptions asked = design_options(options, run);
  const std::vector<fs::path> inputs{options.source / "calibration.json"};
  require_apart(options.output, inputs);
  const OutputFolder folder(options.output, {.command = "plan",
                                             .products = {"plan.csv", "plan.json"},
                                             .inputs = inputs,
                                             .force = options.force});
  const design::RecordingPlan plan =
      plan_recording(run.robot, run.space, run.rivals, asked, console.progress);
  const PlanSummary summary = plan_summary_of(options, run, asked, plan);
  folder.write({{"plan.csv", plan_csv(run, plan)}, {"plan.json", json_text(plan_json(summary))}});
  print_plan(summary, folder, console);
  return ExitCode::kDone;
}

}  // namespace kinescope
