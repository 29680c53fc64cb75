// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/truth/random_dynamics.h"

namespace kinescope {

inline DynamicModel random_arm(int joints, Rng& rng, double prismatic_share = 0.0) {
  return random_masses(
      random_robot({.joints = joints, .prismatic_share = prismatic_share}, rng).tree, {}, rng);
}

}  // namespace kinescope
