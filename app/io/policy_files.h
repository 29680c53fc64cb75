// SPDX-License-Identifier: Apache-2.0
//
// The files of policy search: the policy for a controller, and all that a search needs to go on.
// Schemas: app/io/schema/policy.schema.json, policy_state.schema.json.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "dynamics/policy/mc_pilco.h"
#include "dynamics/policy/systems/particle_band.h"

namespace kinescope {

/// policy.json: enough to run the policy in a controller of one's own.
struct PolicyFile {
  std::string version;  ///< of the program
  std::string system;
  policy::StateLayout layout;
  policy::SensingOptions sensing;
  policy::RbfPolicy policy;
  int trial = 0;          ///< that it was run in
  double promised = 0.0;  ///< expected cost of that trial
  double paid = 0.0;
};

[[nodiscard]] std::string policy_file_text(const PolicyFile& file);
/// Throws bad_input: missing file, another schema, numbers that do not fit each other.
[[nodiscard]] PolicyFile read_policy_file(const std::filesystem::path& path);

/// A search as it stands, with what was asked for (`request`, any document).
struct PolicyStateFile {
  std::string version;
  nlohmann::json request;
  policy::LearnerState state;
  /// What the models promised, one a trial of the state; none of explorations.
  std::vector<std::optional<policy::ParticleBand>> bands;
};

[[nodiscard]] std::string policy_state_text(const PolicyStateFile& file);
/// What was asked for, alone. Throws bad_input.
[[nodiscard]] nlohmann::json read_policy_request(const std::filesystem::path& path);
/// `physics`: of the system, for a semi-parametric model. Throws bad_input.
[[nodiscard]] PolicyStateFile read_policy_state(
    const std::filesystem::path& path, const policy::StateLayout& layout,
    std::shared_ptr<const policy::PhysicsFeatures> physics);

/// velocity_model.json: what a policy was learned on. Schema: velocity_model.schema.json.
[[nodiscard]] std::string velocity_model_text(const policy::VelocityModel& model,
                                              const std::string& version, const std::string& system,
                                              int trials);

/// t, the seen state, the inputs (empty in the last row), where they differ the smoothed and the
/// true state, and what the particles promised.
[[nodiscard]] std::string trial_csv(const policy::Trial& trial, const policy::StateLayout& layout,
                                    const std::optional<policy::ParticleBand>& band = {});

}  // namespace kinescope
