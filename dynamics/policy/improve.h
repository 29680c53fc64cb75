// SPDX-License-Identifier: Apache-2.0
//
// Takes   VelocityModel, PolicyTask, a policy.
// Gives   the policy of the smallest expected cost over the model's particles.
// Method  Adam (Kingma and Ba 2015) on the Monte-Carlo gradient with dropout on the basis
//         functions; step size and dropout are lowered where the cost no longer falls (Amadio et
//         al., T-RO 2022).
#pragma once

#include <functional>
#include <stop_token>

#include "dynamics/policy/particles.h"

namespace kinescope::policy {

struct ImproveOptions {
  int particles = 400;
  int max_steps = 4000;
  double learning_rate = 0.01;
  double min_learning_rate = 0.0025;
  /// Probability that a basis function is absent from a particle's policy at a time; a multiple of
  /// 1/256.
  double dropout = 0.25;
  double dropout_decrement = 0.125;  ///< each time that the step size is halved
  /// Memory of the exponential averages of the cost's change.
  double change_memory = 0.99;
  /// No progress: mean change over its standard deviation below this ..
  double change_ratio = 0.08;
  int patience = 200;  ///< .. in so many steps in a row
  /// A gradient longer than so many times its running average is shortened to that; 0: never.
  double gradient_limit = 10.0;
  int max_resamples = 10;  ///< of a step whose cost is not finite, before the policy is drawn anew
  int threads = 0;         ///< 0: all of the machine. Never changes a result
};

/// Throws bad_request for options that are out of range.
void check_options(const ImproveOptions& options);

/// All that a search needs to go on: a plain value that can be saved after any step.
struct SearchState {
  RbfPolicy policy;
  /// Adam's averages by parameters_of(policy).
  Eigen::VectorXd first_moment;
  Eigen::VectorXd second_moment;
  std::uint64_t seed = 1;
  int step = 0;       ///< gradient steps done
  int adam_step = 0;  ///< since the averages were zero
  double learning_rate = 0.0;
  double dropout = 0.0;
  double last_cost = 0.0;
  double mean_change = 0.0;
  double change_variance = 0.0;
  int change_steps = 0;  ///< since those averages were zero
  int steps_without_progress = 0;
  double gradient_scale = 0.0;  ///< running average of the gradient's length
  int resamples = 0;            ///< in all
  int redraws = 0;              ///< policies drawn anew
  std::vector<double> costs;    ///< one a step
};

enum class SearchStatus {
  kNotRun,
  kConverged,  ///< no progress at the smallest step size
  kStepLimit,
  kStopped,  ///< by the caller
  kFailed,   ///< the cost was not finite whatever was drawn
};

struct SearchProgress {
  int step = 0;
  int max_steps = 0;
  double cost = 0.0;  ///< expected, summed over the horizon
  double learning_rate = 0.0;
  double dropout = 0.0;
  double gradient_norm = 0.0;
};

struct SearchHooks {
  std::function<void(const SearchProgress&)> progress;  ///< after every step; may be empty
  /// After every `save_period` steps, with what would continue from there; may be empty.
  std::function<void(const SearchState&)> save;
  int save_period = 100;
  std::stop_token stop;
};

struct Improvement {
  SearchState search{};  ///< its policy is the result
  SearchStatus status = SearchStatus::kNotRun;
  double cost = 0.0;        ///< expected, of the particles without dropout
  double cost_sigma = 0.0;  ///< of one rollout
};

/// What Adam moves: centres row by row, logarithms of the length scales, weights over the inputs'
/// limits row by row.
[[nodiscard]] Eigen::VectorXd parameters_of(const RbfPolicy& policy);
[[nodiscard]] RbfPolicy with_parameters(RbfPolicy policy, const Eigen::VectorXd& parameters);

[[nodiscard]] SearchState begin_search(RbfPolicy policy, const ImproveOptions& options,
                                       std::uint64_t seed);
/// Goes on from `search`; `redraw` draws a policy where the old one's cost is not finite. Throws
/// undetermined for a cost that never changes, bad_request for what does not fit.
[[nodiscard]] Improvement improve(const VelocityModel& model, const PolicyTask& task,
                                  SearchState search,
                                  const std::function<RbfPolicy(int redraw)>& redraw,
                                  const ImproveOptions& options, const SearchHooks& hooks = {});

}  // namespace kinescope::policy
