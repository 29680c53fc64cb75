// SPDX-License-Identifier: Apache-2.0
//
// Takes   VelocityModel, RbfPolicy, SaturatingCost, where particles start, what the policy sees.
// Gives   the expected cost of a policy over a horizon, its gradient, and the particles themselves.
// Method  Monte-Carlo rollout by the reparametrisation x' = mean + std * draw and a reverse sweep
//         over its tape (Amadio et al., T-RO 2022), in blocks of particles that workers
//         share; draws are counter-based, so that results have the same bits on any number of
//         threads.
#pragma once

#include <cstdint>
#include <vector>

#include "dynamics/policy/cost.h"
#include "dynamics/policy/rbf_policy.h"
#include "dynamics/policy/sensing.h"
#include "dynamics/policy/velocity_model.h"

namespace kinescope::policy {

/// A mixture of normals with equal weights.
struct StartDistribution {
  Eigen::MatrixXd means;  ///< modes x 2 P
  Eigen::VectorXd sigma;  ///< 2 P, of every mode
};

/// What is asked of a policy.
struct PolicyTask {
  SaturatingCost cost;
  StartDistribution start;
  SensingOptions sensing;
  int steps = 60;  ///< of the horizon
};

/// Throws bad_request for what contradicts itself or the layout.
void check_task(const PolicyTask& task, const StateLayout& layout);

/// Particles of a policy on a model, for comparison with a real rollout.
struct ParticleRollout {
  std::vector<Eigen::MatrixXd> states;  ///< steps + 1 of particles x 2 P, true states
  std::vector<Eigen::MatrixXd> inputs;  ///< steps of particles x U
  Eigen::MatrixXd costs;                ///< particles x (steps + 1)

  /// Of the sum over the time of one rollout.
  [[nodiscard]] double mean_cost() const;
  [[nodiscard]] double cost_sigma() const;
};
/// Without dropout.
[[nodiscard]] ParticleRollout roll_out(const VelocityModel& model, const PolicyTask& task,
                                       const RbfPolicy& policy, int particles, std::uint64_t seed,
                                       int threads = 0);

}  // namespace kinescope::policy
