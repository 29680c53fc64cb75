// SPDX-License-Identifier: Apache-2.0
#include "app/torque/saved_model_log.h"

#include <fmt/format.h>

#include "app/io/dynamics_settings.h"
#include "kinematics/core/error.h"
#include "kinematics/recorded/container.h"
#include "kinematics/recorded/recorded_log.h"

namespace kinescope {
namespace {

std::vector<WantedJoint> wanted_by(const RigidModel& rigid) {
  std::vector<WantedJoint> out;
  for (const RigidBody& body : rigid.bodies) {
    out.push_back({body.joint, body.type == JointType::kPrismatic});
  }
  return out;
}

}  // namespace

TorqueDataOptions log_settings(const std::optional<std::filesystem::path>& settings,
                               const std::filesystem::path& log, const TorqueDataOptions& words) {
  const auto container = recorded::container_of(log);
  const std::vector<std::filesystem::path> places =
      container ? recorded::places_of(*container)
                : std::vector<std::filesystem::path>{log.parent_path()};
  std::filesystem::path beside = places.front() / "recording.yaml";
  if (!std::filesystem::exists(beside)) beside = places.back() / "recording.yaml";
  TorqueDataOptions out;
  if (settings) {
    out = read_dynamics_settings(*settings);
  } else if (std::filesystem::exists(beside)) {
    out = read_dynamics_settings(beside);
  }
  const auto take = [](auto& value, const auto& word) {
    if (!word.empty()) value = word;
  };
  LogMapping& mapping = out.mapping;
  take(mapping.time, words.mapping.time);
  take(mapping.time_unit, words.mapping.time_unit);
  take(mapping.position, words.mapping.position);
  take(mapping.velocity, words.mapping.velocity);
  take(mapping.acceleration, words.mapping.acceleration);
  take(mapping.torque, words.mapping.torque);
  take(mapping.position_unit, words.mapping.position_unit);
  take(mapping.velocity_unit, words.mapping.velocity_unit);
  take(mapping.torque_unit, words.mapping.torque_unit);
  take(mapping.torque_factor, words.mapping.torque_factor);
  if (words.mapping.rate_hz > 0.0) mapping.rate_hz = words.mapping.rate_hz;
  if (words.motion.cutoff_hz > 0.0) out.motion.cutoff_hz = words.motion.cutoff_hz;
  return out;
}

TorqueData read_log_for(const TorqueModelFile& file, const std::vector<std::filesystem::path>& logs,
                        TorqueDataOptions data) {
  const TorqueFilter& filter = file.traced ? file.traced->filter : file.filter;
  data.motion.filter = filter.kind;
  data.motion.cutoff_hz = filter.cutoff_hz;  // alike, or residuals are not the model's
  TorqueData out =
      read_torque_data(recorded::read_channel_tables(logs), wanted_by(file.model.rigid), data);
  if (out.samples.torque_unit == file.model.torque_unit) return out;
  throw bad_input(logs.front().string(),
                  fmt::format("its torques are in {}, the model's in {}", out.samples.torque_unit,
                              file.model.torque_unit),
                  "state --torque-unit and --torque-factor as for the log it was learned from");
}

}  // namespace kinescope
