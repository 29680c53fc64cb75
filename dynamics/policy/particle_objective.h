// SPDX-License-Identifier: Apache-2.0
//
// Expected cost of a policy over particles, and its gradient; internal. Blocks of particles are
// shared by workers, their parts added in the order of the particles.
#pragma once

#include <memory>

#include "dynamics/policy/block_rollout.h"

namespace kinescope::policy {

struct ParticleCost {
  double cost = 0.0;    ///< mean over the particles of the sum over the time
  double sigma = 0.0;   ///< of one particle
  double lowest = 0.0;  ///< of one particle at one time
  double highest = 0.0;
};

class ParticleObjective {
 public:
  ParticleObjective(const VelocityModel& model, const PolicyTask& task, int particles,
                    Eigen::Index basis_count, int threads);
  ~ParticleObjective();
  ParticleObjective(const ParticleObjective&) = delete;
  ParticleObjective& operator=(const ParticleObjective&) = delete;

  /// `gradient` is overwritten; null: not wanted. `rollout` likewise, sized by the caller.
  [[nodiscard]] ParticleCost evaluate(const RbfPolicy& policy, const RolloutDraws& draws,
                                      PolicyGradient* gradient, ParticleRollout* rollout = nullptr);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kinescope::policy
