// SPDX-License-Identifier: Apache-2.0
//
// Takes   two finished runs of one robot.
// Gives   how well the model of one predicts the recording of the other on unseen postures, beside
//         that recording's own model.
// Method  the model's joints and the effects at them are held; camera (or tracker) pose, marker
//         mounts and clock are fitted anew on the other folds of the recording. Both errors are of
//         the sightings that its own run used; their difference is tested over stretches of time
//         (paired Student's t).
#pragma once

#include "app/commands/compared_runs.h"

namespace kinescope {

/// `match`: the model's joints in `onto`. What keeps it from being tried (the recording is gone, or
/// another one now) is said in the answer; throws nothing for that.
[[nodiscard]] CarriedOver carry_over(const StoredRun& model, const StoredRun& onto,
                                     const RobotMatch& match, double level);

}  // namespace kinescope
