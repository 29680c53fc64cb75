// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel (kinematics, length of gravity) and TorqueSamples.
// Gives   where the torques say that gravity points.
// Units   base frame, unit vector.
// Method  the regressor is linear in gravity (Atkeson, An, Hollerbach 1986): normal equations for
//         every direction from one pass over the samples, the whole sphere searched; masses and
//         drives (offset, viscous and
//         Coulomb friction, inertia) are free.
// Not here: tilts with intervals and rivals (dynamics/effects, gravity_direction).
#pragma once

#include "dynamics/data/torque_samples.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

struct GravityFromTorques {
  Eigen::Vector3d direction = -Eigen::Vector3d::UnitZ();
  double from_model_rad = 0.0;  ///< from the model's own direction
  /// Rms residual, each joint's over its rms torque, with this direction over that with the
  /// model's own: near 1 where the torques do not care.
  double error_ratio = 1.0;

  /// The model's own direction is wrong, and not by what noise alone asks for.
  [[nodiscard]] bool contradicts() const;
};

/// Of two opposite directions that explain the torques alike (slow motion: masses change sides)
/// the one that is nearer to the model's own. The model's own where it has no gravity.
[[nodiscard]] GravityFromTorques gravity_from_torques(const DynamicModel& model,
                                                      const TorqueSamples& samples);

}  // namespace kinescope
