// SPDX-License-Identifier: Apache-2.0
//
// Takes   the track of one body that several joints in series move, and the log.
// Gives   the offset between the clocks at which the joints' rates explain the body's velocity.
// Method  the body's velocity is J(q) dq, and J is smooth: it is nearly linear in the rates, or in
//         them and their products with values, whatever the order and the types of the joints.
//         What least squares leave, over the offset; of the two models the one with the clearer
//         minimum, since many channels explain a short motion at any offset.
// Why     pairs of bodies with one joint between them show it better (time_offset.h); of a chain
//         without markers between there are none.
#pragma once

#include <optional>

#include "kinematics/log/joint_log.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// Joint-log time = frame time + offset, within +-max_offset_s. Nothing where the motion does not
/// show it: too few frames in a row, a log that stands still, a minimum that is none.
/// Cost O(offsets * frames * channels^4).
[[nodiscard]] std::optional<double> chain_clock_offset(const PoseTrack& track,
                                                       const std::vector<double>& times_s,
                                                       const JointLog& log, double max_offset_s,
                                                       double max_gap_s);

}  // namespace kinescope
