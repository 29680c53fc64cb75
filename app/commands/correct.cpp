// SPDX-License-Identifier: Apache-2.0
//
// `kinescope correct`: a joint log without the effects that a run found.
#include <cstdio>
#include <map>

#include <fmt/format.h>

#include "app/commands/commands.h"
#include "app/io/effects_file.h"
#include "calib/effects/corrected_log.h"
#include "kinematics/core/file.h"
#include "kinematics/log/header_units.h"
#include "kinematics/urdf/urdf.h"

namespace kinescope {
namespace {

std::string log_csv(const JointLog& log) {
  std::string out = without_unit(log.time_column);  // the reader has brought it to s
  for (const std::string& channel : log.channels) out += "," + channel;
  out += "\n";
  for (std::size_t i = 0; i < log.size(); ++i) {
    out += fmt::format("{}", log.times_s[i]);
    for (Eigen::Index c = 0; c < log.values.cols(); ++c) {
      out += fmt::format(",{}", log.values(static_cast<Eigen::Index>(i), c));
    }
    out += "\n";
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
  const CalibratedEffects found = read_effects(options.run_folder / "calibration.json");
  const KinematicTree tree = tree_of_run(options.run_folder, found.channels);
  const JointLog log = read_joint_log(options.log);
  JointLog in_si = log;
  to_si(in_si, found.unit_factors);
  CorrectedLog corrected = corrected_log(in_si, tree, found.effects, found.gravity_base);
  from_si(corrected.log, log, found.unit_factors);
  write_file_atomically(options.output, log_csv(corrected.log));
  if (console.json) {
    const nlohmann::json out{{"undone", effects_list(corrected.undone)},
                             {"left", effects_list(corrected.left)},
                             {"warnings", log.warnings},
                             {"log", options.output.string()}};
    fmt::print("{}\n", out.dump(2));
    return ExitCode::kDone;
  }
  if (console.quiet) return ExitCode::kDone;
  for (const std::string& warning : log.warnings) fmt::print("{}\n", warning);
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
