// SPDX-License-Identifier: Apache-2.0
//
// Masses for robots: bodies that exist, because they are made of particles.
#pragma once

#include "kinematics/core/rng.h"
#include "kinematics/model/dynamic_model.h"
#include "tests/truth/random_robot.h"

namespace kinescope {

struct RandomMassOptions {
  double mass_kg = 2.0;         ///< typical mass of a link; the true ones lie within a factor of 3
  double size_m = 0.15;         ///< spread of a link's particles
  bool every_direction = true;  ///< gravity points anywhere; else down
  bool motors = true;           ///< joints have motor inertia and friction
};

/// Eight particles about a random centre.
[[nodiscard]] InertialParameters random_inertia(const RandomMassOptions& options, Rng& rng);

/// The tree with a random inertia on every link (the root too), friction, motor inertia, gravity.
[[nodiscard]] DynamicModel random_masses(const KinematicTree& tree,
                                         const RandomMassOptions& options, Rng& rng);

/// Joint values, rates and accelerations of one sample, or of many (rows).
struct RandomStates {
  Eigen::MatrixXd q;    ///< revolute joints within half a turn, prismatic ones within 0.5 m
  Eigen::MatrixXd dq;   ///< normal, 1 per s
  Eigen::MatrixXd ddq;  ///< normal, 3 per s^2
};
[[nodiscard]] RandomStates random_states(const KinematicTree& tree, int samples, Rng& rng);

}  // namespace kinescope
