// SPDX-License-Identifier: Apache-2.0
//
// What a model's particles promise of a trial, to be laid beside the trial itself.
#pragma once

#include <Eigen/Core>

#include "dynamics/policy/particles.h"

namespace kinescope::policy {

/// Quantiles over the particles, (steps + 1) x P positions each.
struct ParticleBand {
  Eigen::MatrixXd lower;   ///< 5 %
  Eigen::MatrixXd median;  ///< 50 %
  Eigen::MatrixXd upper;   ///< 95 %
};

/// An angle counts with its whole turns.
[[nodiscard]] ParticleBand particle_band(const ParticleRollout& rollout, Eigen::Index positions);

}  // namespace kinescope::policy
