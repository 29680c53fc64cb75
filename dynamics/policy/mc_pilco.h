// SPDX-License-Identifier: Apache-2.0
//
// Takes   a System and what is asked of it.
// Gives   a policy, learned from few trials: explore with random inputs, then model, policy and
//         trial in turn. After every trial and during each search all that was learned is one plain
//         value that can be saved and continued to the same bits.
// Method  MC-PILCO (Amadio, Dalla Libera, Antonello, Nikovski, Carli, Romeres, T-RO 2022,
//         arXiv 2101.12115); partially measurable systems: arXiv 2101.08740.
// Not here: systems, files, reports.
#pragma once

#include <optional>

#include "dynamics/policy/improve.h"

namespace kinescope::policy {

struct LearnerOptions {
  ModelOptions model;
  PolicyOptions policy;
  ImproveOptions improve;
  int first_max_steps = 2000;  ///< of the search before the first trial; later: improve.max_steps
  int explorations = 1;        ///< rollouts with random inputs
  int trials = 5;              ///< with a learned policy
  /// The policy of the trial before is one of the starts of a search; else all are newly drawn.
  bool keep_policy = true;
  /// Starts of a search: so many policies take `start_steps` steps each, and only the one whose
  /// cost is then lowest goes on. Of 34 single starts on a cart and pole two ended in a policy that
  /// leaves the pole hanging.
  int starts = 3;
  int start_steps = 100;
  int promise_particles = 400;  ///< that the promised cost is measured with
  /// The random input holds each value, uniform within the limits, for so many steps.
  int exploration_hold = 1;
};

/// What a trial with a learned policy came to. Costs are sums over the rollout.
struct TrialRecord {
  double promised = 0.0;             ///< expected over the particles
  double promised_sigma = 0.0;       ///< of one rollout among the particles
  double paid = 0.0;                 ///< of what the policy saw
  std::optional<double> paid_truth;  ///< of the true states, where they are known
  int search_steps = 0;
  SearchStatus search = SearchStatus::kNotRun;
  std::vector<Eigen::Index> samples;  ///< that each process kept
};

/// A plain value. Trials 0 .. explorations - 1 are explorations.
struct LearnerState {
  std::uint64_t seed = 1;
  std::vector<Trial> trials{};
  std::vector<TrialRecord> records{};    ///< one a trial with a learned policy
  std::vector<RbfPolicy> policies{};     ///< one a record
  std::optional<VelocityModel> model{};  ///< learned from the first `model_trials` trials
  int model_trials = 0;
  std::vector<SearchState> starts{};    ///< of the search for the next trial, those that are done
  std::optional<SearchState> search{};  ///< what was stopped or is going on: a start, or the search
};

enum class LearnerStage { kExploring, kModelling, kStarting, kSearching, kTrial, kDone };
struct LearnerProgress {
  LearnerStage stage = LearnerStage::kExploring;
  int trial = 0;  ///< number among all, explorations included
  SearchProgress search;
};

struct LearnerHooks {
  std::function<void(const LearnerProgress&)> progress;
  /// After exploration, model, every `save_period` steps of a search and each trial.
  std::function<void(const LearnerState&)> save;
  int save_period = 100;
  std::stop_token stop;
};

/// Throws bad_request for what contradicts itself.
void check_learner(const System& system, const PolicyTask& task, const LearnerOptions& options);

/// Goes on from `state` (begin with LearnerState{.seed = ..}) for all trials, or until stopped.
/// Throws bad_request for a state of another system or of other options.
/// Throws what the system, the model or the search throw; what was saved before stays valid.
[[nodiscard]] LearnerState learn(const System& system, const PolicyTask& task,
                                 const LearnerOptions& options, LearnerState state,
                                 const LearnerHooks& hooks = {});

/// Sum over a rollout (rows of states) of the cost.
[[nodiscard]] double rollout_cost(const SaturatingCost& cost, const Eigen::MatrixXd& states);

}  // namespace kinescope::policy
