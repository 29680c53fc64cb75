// SPDX-License-Identifier: Apache-2.0
//
// Where a motion leaves what a model has learned from, in words.
#pragma once

#include <string>
#include <vector>

#include "dynamics/models/torque_predictor.h"

namespace kinescope {

/// "joint5 moves 2.0 times as fast here as in what was learned (beyond it at 34 % of the samples)":
/// a sentence for every joint and quantity (position, rate, acceleration); none where the motion
/// stays inside. Positions in deg or mm.
[[nodiscard]] std::vector<std::string> motion_words(const MotionSpan& learned,
                                                    const TorqueSamples& here,
                                                    const RigidModel& rigid);

}  // namespace kinescope
