// SPDX-License-Identifier: Apache-2.0
#include "app/commands/torque_stages.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "app/io/dynamics_settings.h"
#include "kinematics/core/csv.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

// Enough for a first look that does not keep the kinematics waiting.
constexpr int kGpSamples = 600;

std::optional<fs::path> file_named(const Recording& recording, std::string_view name) {
  for (const fs::path& file : recording.files) {
    if (file.filename() == name) return file;
  }
  return std::nullopt;
}

// Torque columns in the file's order: those that are no channel of the joint log and no time.
std::vector<std::string> torque_columns(const fs::path& joints, const JointLog& log) {
  std::vector<std::string> out;
  for (const std::string& column : read_csv(joints).header) {
    if (column == "t" || std::ranges::count(log.channels, column) > 0) continue;
    out.push_back(column);
  }
  return out;
}

// A torque column belongs to the channel whose name it ends with; else the order says which.
std::string torque_of(const std::string& channel, std::size_t place,
                      const std::vector<std::string>& torques) {
  for (const std::string& torque : torques) {
    if (torque.ends_with(channel)) return torque;
  }
  return place < torques.size() ? torques[place] : std::string();
}

// Which columns of joints.csv are what, in the order of the tree's joints; nothing where a joint
// has no torque.
std::optional<LogMapping> mapping_of(const KinematicTree& tree, const JointLog& log,
                                     const std::vector<std::string>& torques, LogMapping mapping) {
  mapping.time = "t";
  for (const Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed) continue;
    const auto channel = log.channel(joint.channel);
    if (!channel) return std::nullopt;
    const std::string torque =
        torque_of(joint.channel, static_cast<std::size_t>(*channel), torques);
    if (torque.empty()) return std::nullopt;
    mapping.position.push_back(joint.channel);
    mapping.torque.push_back(torque);
    mapping.position_factor.push_back(joint.scale);
    mapping.torque_factor.push_back(joint.scale < 0.0 ? -1.0 : 1.0);
  }
  return mapping;
}

}  // namespace

std::vector<std::string> torque_stages(const Recording& recording, const RunOptions& options,
                                       const KinematicTree& tree, const fs::path& folder,
                                       const Progress& progress) {
  if (recording.log.empty()) return {};
  const fs::path joints = recording.log.source;
  const std::vector<std::string> torques = torque_columns(joints, recording.log);
  if (torques.empty()) return {};
  std::vector<std::string> words;
  try {
    TorqueDataOptions data;
    if (const auto settings = file_named(recording, "recording.yaml")) {
      data = read_dynamics_settings(*settings);
    }
    data.mapping.torque.clear();
    const auto mapping = mapping_of(tree, recording.log, torques, data.mapping);
    if (!mapping) return {"Torques: not every joint has a logged channel and a torque column."};
    data.mapping = *mapping;
    DynamicsOptions dynamics;
    dynamics.logs = {joints};
    dynamics.robot = folder / "robot.urdf";
    dynamics.output = folder;
    dynamics.data = data;
    dynamics.trace = options.trace;
    dynamics.robust = false;                      // on request, by kinescope dynamics
    dynamics.trace_file = "dynamics_trace.json";  // trace.json is the calibration's
    dynamics.models = {"parametric", "gip"};      // the others on request, by kinescope dynamics
    dynamics.models_options.samples = kGpSamples;
    dynamics.command_line = options.command_line;
    const TorqueVerdict verdict = torque_verdict(model_torque(dynamics, progress));
    words = {"Torques: " + verdict.found, verdict.accurate, verdict.limits};
    ContactCommandOptions contact;
    contact.logs = {joints};
    contact.robot = folder / "robot_dynamics.urdf";
    contact.output = folder;
    contact.data = data;
    contact.command_line = options.command_line;
    words.push_back("Contacts: " + contact_verdict(find_contacts(contact)));
  } catch (const Error& error) {
    // The kinematics stand all the same.
    words.push_back(fmt::format("Torques could not be used: {}", error.what()));
  }
  return words;
}

}  // namespace kinescope
