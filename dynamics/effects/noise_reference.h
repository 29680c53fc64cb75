// SPDX-License-Identifier: Apache-2.0
//
// How much of a torque residual noise can be, from the residual alone: noise differs from one
// instant to the next, what a model lacks follows the motion and does not. Internal to this room.
#pragma once

#include <Eigen/Core>

#include "dynamics/effects/effect_motion.h"

namespace kinescope::effects {

/// rms of the noise of each joint's residual (instants x joints, any unit), at most: the residual's
/// second differences, by their median size, over what the low-pass leaves of them in noise whose
/// power has fallen by half at half the cut-off, as where a drive's own low-pass has its corner
/// there. (Noise that is slower than that is as slow as the motion.) Of white noise this is 1.3
/// times what it is. Beside it the rounding of torques that are logged in steps, which lasts as
/// long as the torque stays on one. `sigma`: of each joint, by which residuals were divided. 0
/// where fewer than 30 instants have both neighbours.
[[nodiscard]] Eigen::VectorXd noise_at_most(const EffectMotion& motion,
                                            const Eigen::MatrixXd& residual,
                                            const Eigen::VectorXd& sigma);

}  // namespace kinescope::effects
