// SPDX-License-Identifier: Apache-2.0
//
// `kinescope correct`: a joint log without the effects that a run found.
#include <algorithm>
#include <cstdio>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/commands.h"
#include "app/commands/log_range.h"
#include "app/io/effects_file.h"
#include "app/io/output_folder.h"
#include "calib/effects/corrected_log.h"
#include "kinematics/core/file.h"
#include "kinematics/log/header_units.h"
#include "kinematics/log/joint_log_table.h"
#include "kinematics/recorded/recorded_log.h"
#include "kinematics/urdf/urdf.h"

namespace kinescope {
namespace {

// The column under the name that the reader gives a channel.
std::optional<std::size_t> column_of(const CsvTable& table, const std::string& channel) {
  if (const auto exact = table.column(channel)) return exact;
  const auto found = std::ranges::find(table.header, channel, without_unit);
  if (found == table.header.end()) return std::nullopt;
  return static_cast<std::size_t>(found - table.header.begin());
}

// The stamps and the channels that drive the robot; other columns are none of our business.
CsvTable columns_of_run(const CsvTable& table, const CalibratedEffects& run) {
  std::set<std::string> wanted;
  for (const JointChannel& joint : run.channels) {
    if (std::ranges::find(run.effects, EffectId{"early_reading", joint.joint}, &FittedEffect::id) !=
        run.effects.end())
      wanted.insert(joint.copies.begin(), joint.copies.end());
    if (!joint.channel.empty()) wanted.insert(joint.channel);
    for (const ChannelShare& share : joint.couplings) wanted.insert(share.channel);
  }
  std::set<std::size_t> columns;
  for (const std::string& channel : wanted) {
    if (const auto column = column_of(table, channel)) columns.insert(*column);
  }
  if (columns.empty()) {
    throw bad_input(fmt::format("{}:{}", table.source, table.header_line),
                    "has none of the run's channels",
                    fmt::format("its columns should be {}", fmt::join(wanted, ", ")));
  }
  columns.insert(time_column(table));
  CsvTable out = table;
  const auto chosen = [&](const std::vector<std::string>& cells) {
    std::vector<std::string> part;
    for (const std::size_t c : columns) part.push_back(cells[c]);
    return part;
  };
  out.header = chosen(table.header);
  for (std::vector<std::string>& row : out.rows) row = chosen(row);
  return out;
}

// The table with the corrected numbers in their places, in its own units; rows that are no sample
// are left out. A number that did not change keeps its digits.
std::string corrected_csv(CsvTable table, const TableLog& before, const JointLog& corrected) {
  const JointLog& log = before.log;
  const std::size_t time = time_column(table);
  const double time_unit_s = header_factor(table.header[time]);
  std::string out = fmt::format("{}\n", fmt::join(table.header, ","));
  for (std::size_t i = 0; i < log.size(); ++i) {
    std::vector<std::string>& cells = table.rows[before.rows[i]];
    const auto write = [&cells](std::size_t column, double was, double is, double unit) {
      if (is != was) cells[column] = fmt::format("{}", is / unit);
    };
    write(time, log.times_s[i], corrected.times_s[i], time_unit_s);
    for (std::size_t c = 0; c < log.channels.size(); ++c) {
      const auto row = static_cast<Eigen::Index>(i);
      const auto column = static_cast<Eigen::Index>(c);
      write(*column_of(table, log.channels[c]), log.values(row, column),
            corrected.values(row, column), 1.0);
    }
    out += fmt::format("{}\n", fmt::join(cells, ","));
  }
  return out;
}

std::string names_of(const std::vector<EffectId>& effects) {
  std::string out;
  for (const EffectId& id : effects) {
    out += fmt::format("{}{} at {}", out.empty() ? "" : ", ", id.effect, id.place);
  }
  return out;
}

nlohmann::json effects_list(const std::vector<EffectId>& effects) {
  nlohmann::json out = nlohmann::json::array();
  for (const EffectId& id : effects) out.push_back({{"effect", id.effect}, {"place", id.place}});
  return out;
}

// The tree with the channels and their units, which the URDF does not hold.
KinematicTree tree_of_run(const std::filesystem::path& run_folder,
                          const std::vector<JointChannel>& channels) {
  KinematicTree tree = read_urdf(run_folder / "robot.urdf");
  for (const JointChannel& channel : channels) {
    const auto joint = tree.joint(channel.joint);
    if (!joint) continue;
    Joint& driven = tree.joints[joint->index()];
    driven.channel = channel.channel;
    driven.scale = channel.scale;
    driven.offset = channel.offset;
    driven.couplings = channel.couplings;
    driven.copies = channel.copies;
  }
  return tree;
}

void to_si(JointLog& log, const std::map<std::string, double>& factors) {
  for (const auto& [name, factor] : factors) {
    if (const auto channel = log.channel(name)) log.values.col(*channel) *= factor;
  }
}

// What was changed in SI, in the log's own units; the rest keeps its digits.
void from_si(JointLog& log, const JointLog& before, const std::map<std::string, double>& factors) {
  for (const auto& [name, factor] : factors) {
    const auto channel = log.channel(name);
    if (!channel) continue;
    const Eigen::VectorXd own = before.values.col(*channel);
    log.values.col(*channel) = own + (log.values.col(*channel) - factor * own) / factor;
  }
}

}  // namespace

ExitCode correct_command(const CorrectOptions& options, const Console& console) {
  const std::filesystem::path calibration = options.run_folder / "calibration.json";
  require_folder_of(options.output);
  require_new_file(options.output, "--output",
                   {options.log, calibration, options.run_folder / "robot.urdf"}, options.force);
  const CalibratedEffects found = read_effects(calibration);
  const KinematicTree tree = tree_of_run(options.run_folder, found.channels);
  const recorded::LogTable logged = recorded::read_log_table(options.log);
  for (const std::string& warning : logged.warnings) console.warn(warning);
  const CsvTable& table = logged.table;
  const TableLog read = joint_log_of(columns_of_run(table, found));
  const JointLog& log = read.log;
  // Beforehand: what was left out of the log may be why it is refused.
  for (const std::string& warning : log.warnings) console.warn(warning);
  JointLog in_si = log;
  to_si(in_si, found.unit_factors);
  CorrectedLog corrected = corrected_log(in_si, tree, found.effects, found.gravity_base);
  std::vector<std::string> warnings = log.warnings;
  for (std::string& warning : range_warnings(in_si, tree, found, corrected.faded)) {
    console.warn(warning);
    warnings.push_back(std::move(warning));
  }
  from_si(corrected.log, log, found.unit_factors);
  write_file_atomically(options.output, corrected_csv(table, read, corrected.log));
  if (console.json) {
    const nlohmann::json out{{"undone", effects_list(corrected.undone)},
                             {"left", effects_list(corrected.left)},
                             {"warnings", warnings},
                             {"log", options.output.string()}};
    console.print(out);
    return ExitCode::kDone;
  }
  fmt::print("{}\n",
             corrected.undone.empty()
                 ? std::string("The run found no effect that a joint log shows: nothing to undo.")
                 : "Undone: " + names_of(corrected.undone) + ".");
  if (!corrected.left.empty()) {
    fmt::print("A joint log cannot show: {}.\n", names_of(corrected.left));
  }
  fmt::print("log     {}\n", options.output.string());
  return ExitCode::kDone;
}

}  // namespace kinescope
