// SPDX-License-Identifier: Apache-2.0
//
// A policy search with its folder: begun, gone on with, and all that it has learned so far written
// after every trial.
#pragma once

#include "app/commands/policy.h"
#include "app/io/output_folder.h"
#include "app/io/policy_files.h"
#include "app/report/policy_report.h"

namespace kinescope {

/// What is to be learned, from the command line.
struct PolicyRequest {
  policy::PolicyProblem problem;
  nlohmann::json fingerprint;     ///< what must be the same for a search to go on
  std::vector<InputFile> inputs;  ///< of a user's own system
  std::vector<std::pair<std::string, std::string>> settings;
};

/// Throws bad_request for a name that is none, bad_input for a file that cannot be read.
[[nodiscard]] PolicyRequest make_policy_request(const PolicyCommandOptions& options);

/// Names of what is written for so many trials, explorations included.
[[nodiscard]] std::vector<std::string> policy_products(int trials);

class PolicySearch {
 public:
  PolicySearch(PolicyRequest request, const PolicyCommandOptions& options,
               const OutputFolder& folder);

  /// Goes on with what the folder holds; `fresh`: begins anew. Throws bad_request where it holds
  /// another search.
  void open(bool fresh);
  /// Until all trials are done.
  void run(const Console& console);

  [[nodiscard]] const PolicySummary& summary() const { return summary_; }

 private:
  void save(const policy::LearnerState& state);
  void add_trials(const policy::LearnerState& state);
  void write_products(const policy::LearnerState& state) const;

  PolicyRequest request_;
  const OutputFolder& folder_;
  int threads_;
  policy::LearnerState state_;
  std::vector<std::optional<policy::ParticleBand>> bands_;  ///< one a trial
  PolicySummary summary_;
};

}  // namespace kinescope
