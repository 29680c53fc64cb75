// SPDX-License-Identifier: Apache-2.0
//
// Takes   the trials of a policy search.
// Gives   the page and its document (schema: app/io/schema/policy_search.schema.json).
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"
#include "dynamics/policy/systems/particle_band.h"
#include "dynamics/policy/systems/problem.h"

namespace kinescope {

struct PolicyTrialSummary {
  policy::Trial trial;
  std::optional<policy::TrialRecord> record;      ///< none: explored at random
  std::optional<policy::ParticleBand> particles;  ///< that the model promised
  bool success = false;
};

struct PolicySummary {
  policy::PolicyProblem problem;
  std::string version;
  std::string command;
  std::vector<InputFile> inputs;  ///< of a user's own system
  std::vector<std::pair<std::string, std::string>> settings;
  std::vector<PolicyTrialSummary> trials;
};

/// The cost that a trial came to: by its true states where they are known.
[[nodiscard]] double cost_paid(const policy::TrialRecord& record);
/// The first trial with a policy that was a success; explorations count, from 0.
[[nodiscard]] std::optional<std::size_t> first_success(const PolicySummary& summary);

/// A sentence each, as the command prints them.
[[nodiscard]] std::vector<std::string> policy_findings(const PolicySummary& summary);
[[nodiscard]] nlohmann::json policy_search_json(const PolicySummary& summary);
[[nodiscard]] std::string policy_html(const PolicySummary& summary);

}  // namespace kinescope
