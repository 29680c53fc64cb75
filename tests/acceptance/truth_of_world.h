// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/acceptance/truth_robot.h"
#include "tests/truth/camera_world.h"

namespace kinescope::acceptance {

/// The robot of a world, over the ranges that its frames show.
[[nodiscard]] inline TruthRobot truth_of(const truth::World& world) {
  TruthRobot truth;
  truth.tree = world.tree;
  for (Eigen::Index j = 0; j < world.joint_values.cols(); ++j) {
    const auto values = world.joint_values.col(j);
    truth.range.push_back({values.minCoeff(), values.maxCoeff()});
  }
  return truth;
}

}  // namespace kinescope::acceptance
