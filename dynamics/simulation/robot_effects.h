// SPDX-License-Identifier: Apache-2.0
//
// The library of effects for a robot on a motion, so that effects which somebody wrote down can be
// checked against it.
#pragma once

#include <vector>

#include "dynamics/effects/effect_library.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

struct RobotEffects {
  std::vector<Candidate> candidates;
  std::vector<JointTravel> travels;  ///< of every joint on the motion
  LogSpan log;
};

/// `motion`: without torques, at its own rate.
[[nodiscard]] RobotEffects effects_of_robot(const DynamicModel& model, const TorqueSamples& motion);

}  // namespace kinescope
