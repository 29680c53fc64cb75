// SPDX-License-Identifier: Apache-2.0
//
// What policy search learns as members of a JSON document (app/io/schema/policy.schema.json,
// velocity_model.schema.json, policy_state.schema.json). Numbers read back the same to the last
// bit; readers throw bad_input.
#pragma once

#include <nlohmann/json.hpp>

#include "dynamics/models/json_reader.h"
#include "dynamics/policy/improve.h"

namespace kinescope {

/// A list of rows.
[[nodiscard]] nlohmann::json matrix_json(const Eigen::MatrixXd& values);

/// Positions, inputs and step.
[[nodiscard]] nlohmann::json layout_json(const policy::StateLayout& layout);

[[nodiscard]] nlohmann::json rbf_policy_json(const policy::RbfPolicy& policy);
/// One of this layout.
[[nodiscard]] policy::RbfPolicy rbf_policy_of(const nlohmann::json& object,
                                              const policy::StateLayout& layout,
                                              const JsonReader& read);

[[nodiscard]] nlohmann::json trial_json(const policy::Trial& trial);
[[nodiscard]] policy::Trial trial_of(const nlohmann::json& object,
                                     const policy::StateLayout& layout, const JsonReader& read);

/// Kernel and processes.
[[nodiscard]] nlohmann::json velocity_model_json(const policy::VelocityModel& model);
/// `physics`: of a semi-parametric model.
[[nodiscard]] policy::VelocityModel velocity_model_of(
    const nlohmann::json& object, const policy::StateLayout& layout,
    std::shared_ptr<const policy::PhysicsFeatures> physics, const JsonReader& read);

[[nodiscard]] nlohmann::json search_json(const policy::SearchState& search);
[[nodiscard]] policy::SearchState search_of(const nlohmann::json& object,
                                            const policy::StateLayout& layout,
                                            const JsonReader& read);

[[nodiscard]] std::uint64_t seed_of(const nlohmann::json& object, const JsonReader& read);

/// "converged", "step limit", ..
[[nodiscard]] std::string word_of(policy::SearchStatus status);
[[nodiscard]] policy::SearchStatus search_status_of(const std::string& word,
                                                    const JsonReader& read);

}  // namespace kinescope
