// SPDX-License-Identifier: Apache-2.0
#include "app/commands/torque_stages.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "app/io/dynamics_settings.h"
#include "app/io/output_folder.h"
#include "app/torque/find_contacts.h"
#include "app/torque/model_torque.h"
#include "kinematics/recorded/recorded_log.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

// Enough for a first look that does not keep the kinematics waiting.
constexpr int kGpSamples = 600;
constexpr double kGravity = 9.81;  // m/s^2

std::optional<fs::path> listed_file(const Recording& recording, std::string_view name) {
  for (const fs::path& file : recording.files) {
    if (file.filename() == name) return file;
  }
  return std::nullopt;
}

// A torque column belongs to the channel whose name it ends with; else the order says which, unless
// a column is missing in it.
std::string torque_of(const std::string& channel, const JointLog& log) {
  const std::vector<std::string>& torques = log.torque_columns;
  for (const std::string& torque : torques) {
    if (torque.ends_with(channel)) return torque;
  }
  if (!log.left_out.empty() && torques.size() != log.channels.size()) return {};
  const auto place = static_cast<std::size_t>(value_of(log.channel(channel)));
  return place < torques.size() ? torques[place] : std::string();
}

// Which columns of joints.csv are what, in the order of the tree's joints; nothing where a joint
// has no torque.
std::optional<LogMapping> mapping_of(const KinematicTree& tree, const JointLog& log,
                                     LogMapping mapping) {
  mapping.time = log.time_column;
  for (const Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed) continue;
    if (!log.channel(joint.channel)) return std::nullopt;
    const std::string torque = torque_of(joint.channel, log);
    if (torque.empty()) return std::nullopt;
    const recorded::TorqueColumns columns =
        recorded::torque_columns(log.source, joint.channel, torque);
    mapping.position.push_back(columns.position);
    mapping.torque.push_back(columns.torque);
    const auto unit = log.unit_factors.find(joint.channel);
    mapping.position_factor.push_back(unit == log.unit_factors.end() ? joint.scale
                                                                     : joint.scale * unit->second);
    mapping.torque_factor.push_back(joint.scale < 0.0 ? -1.0 : 1.0);
  }
  return mapping;
}

std::vector<std::string> torque_products(const DynamicsOptions& options,
                                         const TorqueSummary& summary) {
  std::vector<std::string> out = dynamics_products("");
  if (!summary.trace) return out;
  if (summary.trace->verdict != TraceVerdict::kNothingToSay) {
    return dynamics_products(options.trace_file);
  }
  out.push_back(options.trace_file);
  return out;
}

}  // namespace

TorqueStages torque_stages(const Recording& recording, const RunOptions& options,
                           const Calibration& calibration, const fs::path& folder,
                           const Progress& progress) {
  if (recording.log.empty()) return {};
  const fs::path joints = recording.log.source;
  if (recording.log.torque_columns.empty()) return {};
  TorqueStages out;
  try {
    TorqueDataOptions data;
    if (const auto settings = listed_file(recording, "recording.yaml")) {
      data = read_dynamics_settings(*settings);
    }
    data.mapping.torque.clear();
    const auto mapping = mapping_of(calibration.tree, recording.log, data.mapping);
    if (!mapping) {
      return {.words = {"Torques: not every joint has a logged channel and a torque column."}};
    }
    if (std::ranges::any_of(calibration.tree.joints,
                            [](const Joint& joint) { return joint.offset != 0.0; })) {
      return {.words = {"Torques: not modelled: joints are logged in units and from zeros of their "
                        "own; log rad and m beside torques."}};
    }
    data.mapping = *mapping;
    DynamicsOptions dynamics;
    dynamics.logs = {joints};
    dynamics.robot = folder / "robot.urdf";
    dynamics.output = folder;
    dynamics.data = data;
    if (const auto& gravity = recording.settings.gravity) {
      dynamics.gravity_m_s2 =
          kGravity * (calibration.T_camera_base.rotation.inverse() * gravity->normalized());
    }
    // Else z of the base is a marker's normal, as likely as not.
    dynamics.gravity_from_torques = true;
    dynamics.trace = options.trace;
    dynamics.robust = false;                      // on request, by kinescope dynamics
    dynamics.trace_file = "dynamics_trace.json";  // trace.json is the calibration's
    dynamics.models = {"parametric", "gip"};      // the others on request, by kinescope dynamics
    dynamics.models_options.samples = kGpSamples;
    dynamics.owner = "run";
    dynamics.force = options.force;
    dynamics.command_line = options.command_line;
    const TorqueSummary summary = model_torque(dynamics, progress);
    out.products = torque_products(dynamics, summary);
    const TorqueVerdict verdict = torque_verdict(summary);
    out.words = {"Torques: " + verdict.found, verdict.accurate, verdict.limits};
    if (!verdict.gravity.empty()) out.words.push_back(verdict.gravity);
    ContactCommandOptions contact;
    contact.logs = {joints};
    contact.robot = folder / "robot_dynamics.urdf";
    contact.output = folder;
    contact.data = data;
    contact.gravity_m_s2 = summary.gravity_m_s2;
    contact.owner = dynamics.owner;
    contact.force = options.force;
    contact.command_line = options.command_line;
    out.words.push_back("Contacts: " + contact_verdict(find_contacts(contact)));
    const std::vector<std::string> contacts = contact_products();
    out.products.insert(out.products.end(), contacts.begin(), contacts.end());
  } catch (const Error& error) {
    // The kinematics stand all the same.
    out.words.push_back(fmt::format("Torques could not be used: {}", error.what()));
  }
  return out;
}

}  // namespace kinescope
