// SPDX-License-Identifier: Apache-2.0
//
// `kinescope inspect` on a torque log: what `kinescope dynamics` would take from it, and what is
// wrong with it.
#include <algorithm>
#include <cstdio>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands/inspection.h"
#include "app/torque/torque_inputs.h"
#include "dynamics/data/splits.h"
#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"
#include "kinematics/log/channel_table.h"
#include "kinematics/recorded/container.h"
#include "kinematics/recorded/recorded_log.h"

namespace kinescope {
namespace {

SignalFacts signal_of(const std::vector<std::string>& columns, const Eigen::MatrixXd& values,
                      Eigen::Index joint, std::string unit) {
  SignalFacts out;
  if (joint >= values.cols()) return out;
  const auto at = static_cast<std::size_t>(joint);
  out.column = at < columns.size() ? columns[at] : "";
  out.unit = std::move(unit);
  bool first = true;
  for (const double value : values.col(joint)) {
    if (!std::isfinite(value)) continue;
    out.lower = first ? value : std::min(out.lower, value);
    out.upper = first ? value : std::max(out.upper, value);
    first = false;
  }
  return out;
}

void look_at_joints(const TorqueLog& log, TorqueLogFacts& facts) {
  for (Eigen::Index j = 0; j < log.columns(); ++j) {
    const WantedJoint& joint = log.joints[static_cast<std::size_t>(j)];
    const std::string angle = joint.prismatic ? "m" : "rad";
    const std::string force = log.torque_unit == "Nm" && joint.prismatic ? "N" : log.torque_unit;
    facts.joints.push_back({joint.name, signal_of(log.q_columns, log.q, j, angle),
                            signal_of(log.dq_columns, log.dq, j, angle + "/s"),
                            signal_of(log.ddq_columns, log.ddq, j, angle + "/s^2"),
                            signal_of(log.torque_columns, log.torque, j, force)});
  }
}

void look_at_times(const TorqueLog& log, TorqueLogFacts& facts) {
  const std::vector<Eigen::Index> bounds = log.bounds();
  facts.trajectories = bounds.empty() ? 0 : static_cast<int>(bounds.size()) - 1;
  for (std::size_t k = 0; k + 1 < bounds.size(); ++k) {
    facts.duration_s += log.t_s[bounds[k + 1] - 1] - log.t_s[bounds[k]];
  }
  const double step_s = median_of(steps_of(log.t_s, log.trajectory));
  facts.rate_hz = step_s > 0.0 ? 1.0 / step_s : 0.0;
}

// The torque against the masses of the robot, as `kinescope dynamics` compares them.
void look_at_scale(const std::filesystem::path& file, const DynamicModel& model,
                   const TorqueLogReport& report, const TorqueDataOptions& options,
                   std::vector<LogFinding>& findings) {
  if (!has_masses(model) || report.log.torque.cols() == 0 || report.log.torque_unit == "A") return;
  const TorqueSamples samples = measured_part(filtered_data(report, options.motion).samples);
  const TorqueScales scales = torque_scales(make_rigid_model(model), samples, {file});
  findings.insert(findings.end(), scales.findings.begin(), scales.findings.end());
}

void note_missing_torques(const std::filesystem::path& log, TorqueLogFacts& facts) {
  if (facts.joints.empty() || !facts.joints.front().torque.column.empty()) return;
  facts.findings.push_back(
      {true, fmt::format("{}: no torque columns: kinescope dynamics and contact have nothing to "
                         "learn from (name them with --torque, or log motor currents with "
                         "--torque-unit A)",
                         log.string())});
}

/// The robot, where one is named and can be read; else its problem is noted, apart from the log's.
std::optional<TorqueRobot> robot_of(const InspectOptions& options, TorqueLogFacts& facts) {
  if (!options.robot) return std::nullopt;
  try {
    return read_torque_robot(*options.robot, std::nullopt);
  } catch (const Error& error) {
    if (error.code() == ExitCode::kBadRequest) throw;
    facts.findings.push_back({true, error.what()});
    return std::nullopt;
  }
}

}  // namespace

bool TorqueLogFacts::ready() const { return std::ranges::none_of(findings, &Finding::problem); }

TorqueLogFacts look_at_torques(const InspectOptions& options) {
  const std::filesystem::path& file = options.recording.folder;
  TorqueLogFacts facts;
  facts.log = recorded::short_name(file);
  try {
    const std::optional<TorqueRobot> robot = robot_of(options, facts);
    const TorqueLogReport report = look_at_torque_log(
        recorded::read_channel_tables({file}),
        robot ? wanted_joints(robot->model.tree) : std::vector<WantedJoint>{}, options.data);
    facts.rows = static_cast<int>(report.rows_read);
    facts.rows_used = static_cast<int>(report.log.rows());
    look_at_joints(report.log, facts);
    look_at_times(report.log, facts);
    std::vector<LogFinding> findings = report.findings;
    const bool refused =
        std::ranges::count(findings, FaultWeight::kRefusal, &LogFinding::weight) > 0;
    if (robot && !refused) look_at_scale(file, robot->model, report, options.data, findings);
    for (const LogFinding& finding : findings) {
      facts.findings.push_back({finding.weight == FaultWeight::kRefusal, to_line(finding)});
    }
    note_missing_torques(file, facts);
  } catch (const Error& error) {
    if (error.code() == ExitCode::kBadRequest) throw;
    facts.findings.push_back({true, error.what()});
  }
  return facts;
}

namespace {

void print_signal(const char* name, const SignalFacts& signal) {
  if (signal.column.empty()) return;
  fmt::print("    {:<13} {:<20} {:>10.4g} to {:>10.4g} {}\n", name, signal.column, signal.lower,
             signal.upper, signal.unit);
}

nlohmann::json signal_json(const SignalFacts& signal) {
  if (signal.column.empty()) return nullptr;
  return {{"column", signal.column},
          {"lower", signal.lower},
          {"upper", signal.upper},
          {"unit", signal.unit}};
}

}  // namespace

void print_torque_log(const TorqueLogFacts& facts) {
  fmt::print("torques   {}: {} rows, {} used, {:.1f} s in {} trajector{}, {:.1f} Hz\n", facts.log,
             facts.rows, facts.rows_used, facts.duration_s, facts.trajectories,
             facts.trajectories == 1 ? "y" : "ies", facts.rate_hz);
  for (const TorqueJointFacts& joint : facts.joints) {
    fmt::print("  joint {}\n", joint.name);
    print_signal("position", joint.position);
    print_signal("velocity", joint.velocity);
    print_signal("acceleration", joint.acceleration);
    print_signal("torque", joint.torque);
  }
  for (const Finding& finding : facts.findings) {
    fmt::print("{} {}\n", finding.problem ? "problem  " : "note     ", finding.text);
  }
  const auto problems = std::ranges::count(facts.findings, true, &Finding::problem);
  fmt::print("verdict   {}\n", facts.ready() ? "ready for kinescope dynamics and contact"
                                             : fmt::format("not ready: {} problem{}", problems,
                                                           problems == 1 ? "" : "s"));
}

nlohmann::json torque_log_json(const TorqueLogFacts& facts) {
  nlohmann::json out = {{"schema", 1},
                        {"torque_log", facts.log},
                        {"ready", facts.ready()},
                        {"rows", facts.rows},
                        {"rows_used", facts.rows_used},
                        {"trajectories", facts.trajectories},
                        {"duration_s", facts.duration_s},
                        {"rate_hz", facts.rate_hz},
                        {"joints", nlohmann::json::array()},
                        {"problems", nlohmann::json::array()},
                        {"notes", nlohmann::json::array()}};
  for (const TorqueJointFacts& joint : facts.joints) {
    out["joints"].push_back({{"name", joint.name},
                             {"position", signal_json(joint.position)},
                             {"velocity", signal_json(joint.velocity)},
                             {"acceleration", signal_json(joint.acceleration)},
                             {"torque", signal_json(joint.torque)}});
  }
  for (const Finding& finding : facts.findings) {
    out[finding.problem ? "problems" : "notes"].push_back(finding.text);
  }
  return out;
}

}  // namespace kinescope
