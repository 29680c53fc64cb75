// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/torque_data.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "dynamics/data/column_names.h"
#include "dynamics/data/log_checks.h"
#include "dynamics/data/statistics.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"
#include "kinematics/log/channel_table.h"

namespace kinescope {
namespace {

void append(std::vector<LogFinding>& findings, const std::vector<LogFinding>& more) {
  findings.insert(findings.end(), more.begin(), more.end());
}

bool is_used(const TorqueLog& log, const std::string& name) {
  const auto in = [&](const std::vector<std::string>& names) {
    return std::ranges::find(names, name) != names.end();
  };
  return in(log.q_columns) || in(log.dq_columns) || in(log.ddq_columns) || in(log.torque_columns);
}

/// Broken cells in columns that are not asked for: worth a note, no reason to leave rows out.
std::vector<LogFinding> look_at_rest(const ChannelTable& table, const TorqueLog& log) {
  std::vector<LogFinding> findings;
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    const std::optional<ColumnMeaning> meaning = read_column_name(table.names[c]);
    const bool clock = meaning && meaning->quantity == LoggedQuantity::kTime;
    if (clock || is_used(log, table.names[c])) continue;
    Eigen::Index missing = 0, infinite = 0, first = -1;
    for (Eigen::Index row = 0; row < table.rows(); ++row) {
      const double value = table.values(row, static_cast<Eigen::Index>(c));
      if (std::abs(value) <= kAbsurdValue) continue;
      (std::isnan(value) ? missing : infinite) += 1;
      if (first < 0) first = row;
    }
    if (first < 0) continue;
    findings.push_back({infinite > 0 ? LogFault::kInfinite : LogFault::kNotANumber,
                        FaultWeight::kNote, table.names[c],
                        static_cast<double>(missing + infinite) / static_cast<double>(table.rows()),
                        static_cast<double>(missing + infinite), table.place(first),
                        fmt::format("column '{}' holds {} empty and {} infinite cells",
                                    table.names[c], missing, infinite),
                        "the column is not used"});
  }
  return findings;
}

std::vector<LogFinding> said_by_reader(const ChannelTable& table) {
  std::vector<LogFinding> findings;
  for (const std::string& warning : table.warnings) {
    const std::size_t colon = warning.find(": ");  // "file: what"
    const std::size_t what = colon == std::string::npos ? 0 : colon + 2;
    findings.push_back({LogFault::kReading, FaultWeight::kWarning, "", 0.0, 0.0,
                        what == 0 ? table.source : warning.substr(0, colon), warning.substr(what),
                        "the rest is used"});
  }
  return findings;
}

std::vector<ChannelTable> read_tables(const std::vector<std::filesystem::path>& files) {
  std::vector<ChannelTable> tables;
  for (const std::filesystem::path& file : files) tables.push_back(read_channel_table(file));
  return tables;
}

/// Which fault: sampling faults are the same for every file, so files are checked together.
TorqueLogReport read_and_check(const std::vector<ChannelTable>& tables,
                               const std::vector<WantedJoint>& joints,
                               const TorqueDataOptions& options, bool torque_required) {
  if (tables.empty()) throw bad_request("dynamics", "no torque log is named", "name one or more");
  TorqueLogReport out;
  std::vector<TorqueLog> logs;
  for (const ChannelTable& table : tables) {
    append(out.findings, said_by_reader(table));
    ReadTorqueLog read = to_torque_log(table, options.mapping, joints, torque_required);
    append(out.findings, read.findings);
    append(out.findings, look_at_rest(table, read.log));
    logs.push_back(std::move(read.log));
  }
  TorqueLog log = join(logs);
  out.rows_read = log.rows();
  CheckedLog checked = check_log(std::move(log), options.checks);
  append(out.findings, checked.findings);
  out.log = std::move(checked.log);
  std::ranges::stable_sort(out.findings, std::greater<>{}, &LogFinding::weight);
  return out;
}

}  // namespace

std::vector<WantedJoint> wanted_joints(const KinematicTree& tree) {
  std::vector<WantedJoint> out;
  for (const Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed) continue;
    out.push_back({joint.name, joint.type == JointType::kPrismatic});
  }
  return out;
}

TorqueLogReport look_at_torque_log(const std::vector<ChannelTable>& tables,
                                   const std::vector<WantedJoint>& joints,
                                   const TorqueDataOptions& options) {
  return read_and_check(tables, joints, options, false);
}

TorqueLogReport read_checked_log(const std::vector<ChannelTable>& tables,
                                 const std::vector<WantedJoint>& joints,
                                 const TorqueDataOptions& options) {
  TorqueLogReport report = read_and_check(tables, joints, options, true);
  throw_refusals(report.findings);
  return report;
}

TorqueData read_torque_data(const std::vector<ChannelTable>& tables,
                            const std::vector<WantedJoint>& joints,
                            const TorqueDataOptions& options) {
  return filtered_data(read_checked_log(tables, joints, options), options.motion);
}

TorqueLogReport look_at_torque_log(const std::vector<std::filesystem::path>& files,
                                   const std::vector<WantedJoint>& joints,
                                   const TorqueDataOptions& options) {
  return look_at_torque_log(read_tables(files), joints, options);
}

TorqueLogReport read_checked_log(const std::vector<std::filesystem::path>& files,
                                 const std::vector<WantedJoint>& joints,
                                 const TorqueDataOptions& options) {
  return read_checked_log(read_tables(files), joints, options);
}

TorqueData read_torque_data(const std::vector<std::filesystem::path>& files,
                            const std::vector<WantedJoint>& joints,
                            const TorqueDataOptions& options) {
  return read_torque_data(read_tables(files), joints, options);
}

TorqueData filtered_data(const TorqueLogReport& report, const MotionOptions& options) {
  Motion motion = derive_motion(report.log, options);
  TorqueData out;
  out.samples = std::move(motion.samples);
  out.findings = report.findings;
  append(out.findings, motion.findings);
  std::ranges::stable_sort(out.findings, std::greater<>{}, &LogFinding::weight);
  out.filter = motion.filter;
  out.source = motion.source;
  out.cutoff = motion.cutoff;
  out.rate_hz = motion.rate_hz;
  const double step_s = median_of(steps_of(report.log.t_s, report.log.trajectory));
  out.log_rate_hz = step_s > 0.0 ? 1.0 / step_s : 0.0;
  out.rows_read = report.rows_read;
  out.rows_used = report.log.rows();
  return out;
}

}  // namespace kinescope
