// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/report/control_summary.h"
#include "app/report/result_values.h"

namespace kinescope {
namespace {

using nlohmann::json;
using report::number;
using report::numbers;
using report::text;

std::string unit_of(const ControlSummary& summary, std::size_t joint) {
  return summary.types[joint] == JointType::kPrismatic ? "m" : "rad";
}

/// "0.0123 rad at joint4".
std::string worst_words(const ControlSummary& summary, const ControlRun& run) {
  const std::size_t worst = worst_joint(run);
  return fmt::format("{:.3g} {} rms at {}", run.error[static_cast<Eigen::Index>(worst)],
                     unit_of(summary, worst), summary.joints[worst]);
}

/// How much smaller the errors are than those of PD with nominal gravity under the same load.
std::string ratio_words(const ControlSummary& summary, const ControlRun& before,
                        const ControlRun& after) {
  const Eigen::VectorXd ratio = before.error.cwiseQuotient(after.error);
  Eigen::Index least = 0;
  Eigen::Index most = 0;
  ratio.minCoeff(&least);
  ratio.maxCoeff(&most);
  return fmt::format("reduced {:.3g} ({}) to {:.3g} ({}) times against {}", ratio[least],
                     summary.joints[static_cast<std::size_t>(least)], ratio[most],
                     summary.joints[static_cast<std::size_t>(most)], before.name);
}

const ControlRun* baseline_of(const ControlSummary& summary, const ControlRun& run) {
  const auto found = std::ranges::find_if(summary.runs, [&](const ControlRun& one) {
    return one.learned.empty() && one.law == ControlLaw::kPdGravity &&
           (one.payload == "none") == (run.payload == "none");
  });
  return found == summary.runs.end() ? nullptr : &*found;
}

json run_json(const ControlSummary& summary, const ControlRun& run) {
  std::vector<int> limited(run.limited.data(), run.limited.data() + run.limited.size());
  return {{"name", text(run.name)},
          {"law", to_string(run.law)},
          {"learned", run.learned.empty() ? json() : json(run.learned)},
          {"payload", run.payload},
          {"round", run.round ? json(*run.round) : json()},
          {"log", text(run.log)},
          {"error", numbers(run.error)},
          {"largest_error", numbers(run.largest)},
          {"worst_joint", text(summary.joints[worst_joint(run)])},
          {"feedback_share", numbers(run.feedback)},
          {"learned_weight", numbers(run.weight)},
          {"limited_periods", std::move(limited)}};
}

json servo_json(const ServoOptions& servo) {
  return {{"rate_hz", number(servo.rate_hz)},
          {"bandwidth_hz", number(servo.bandwidth_hz)},
          {"kp", numbers(servo.kp)},
          {"kd", numbers(servo.kd)},
          {"velocity_cutoff_hz", number(servo.velocity_cutoff_hz)},
          {"delay_s", number(servo.delay_s)},
          {"encoder_step", number(servo.encoder_step)},
          {"torque_noise", number(servo.torque_noise)},
          {"torque_limit", numbers(servo.torque_limit)},
          {"torque_rate_limit", numbers(servo.torque_rate_limit)}};
}

json payload_json(const ControlSummary& summary) {
  if (!summary.payload_kg || !summary.payload) return nullptr;
  const PayloadEstimate& own = *summary.payload;
  return {{"link", text(own.link)},           {"true_kg", number(*summary.payload_kg)},
          {"mass_kg", number(own.mass_kg)},   {"lower_kg", number(own.lower_kg)},
          {"upper_kg", number(own.upper_kg)}, {"centre_m", report::vector3(own.centre_m)}};
}

std::string payload_words(const ControlSummary& summary) {
  const PayloadEstimate& own = *summary.payload;
  return fmt::format(
      "The load of {:g} kg is identified as {:.4g} kg (95 % interval {:.4g} to "
      "{:.4g}) from the logs with and without it.",
      *summary.payload_kg, own.mass_kg, own.lower_kg, own.upper_kg);
}

std::string limit_words(const ControlSummary& summary) {
  std::string out;
  for (const ControlRun& run : summary.runs) {
    if (run.limited.maxCoeff() == 0) continue;
    out += fmt::format("{}{}", out.empty() ? "A limit of torque held in: " : ", ", run.name);
  }
  return out.empty() ? out : out + ".";
}

}  // namespace

std::size_t worst_joint(const ControlRun& run) {
  Eigen::Index worst = 0;
  run.error.maxCoeff(&worst);
  return static_cast<std::size_t>(worst);
}

std::vector<std::string> control_findings(const ControlSummary& summary) {
  std::vector<std::string> out;
  for (const ControlRun& run : summary.runs) {
    std::string words = fmt::format("{}: {}", run.name, worst_words(summary, run));
    const ControlRun* before = baseline_of(summary, run);
    if (!run.learned.empty() && before != nullptr) {
      words += "; " + ratio_words(summary, *before, run);
    }
    out.push_back(words + ".");
  }
  if (summary.payload) out.push_back(payload_words(summary));
  if (std::string words = limit_words(summary); !words.empty()) out.push_back(std::move(words));
  return out;
}

json control_json(const ControlSummary& summary) {
  json joints = json::array();
  for (std::size_t j = 0; j < summary.joints.size(); ++j) {
    joints.push_back({{"name", text(summary.joints[j])}, {"unit", unit_of(summary, j)}});
  }
  json runs = json::array();
  for (const ControlRun& run : summary.runs) runs.push_back(run_json(summary, run));
  return {{"schema", "kinescope.control"},
          {"schema_version", 1},
          {"version", text(summary.version)},
          {"robot", text(summary.robot)},
          {"command", text(summary.command)},
          {"inputs", report::inputs_json(summary.inputs)},
          {"seed", summary.seed},
          {"samples", summary.samples},
          {"model", summary.model.empty() ? json() : text(summary.model)},
          {"training", summary.training.empty() ? json() : text(summary.training)},
          {"joints", std::move(joints)},
          {"servo", servo_json(summary.servo)},
          {"payload", payload_json(summary)},
          {"runs", std::move(runs)},
          {"findings", report::texts(control_findings(summary))}};
}

}  // namespace kinescope
