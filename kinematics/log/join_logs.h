// SPDX-License-Identifier: Apache-2.0
//
// Logs of one robot, one after the other, as one.
#pragma once

#include "kinematics/log/joint_log.h"

namespace kinescope {

/// `first`, and behind it `second`, whose stamps are moved by `start_s` and whose channels are
/// brought into the order of the first. `apart`: they are recordings of their own, and nothing is
/// known of what lies between (JointLog::joined_at_s); else the second goes on where the first
/// ends. Throws bad_input where the channels are not the same, naming those that are missing; a
/// second log that does not begin behind the end of the first is a fault of the caller's.
[[nodiscard]] JointLog joined_logs(JointLog first, const JointLog& second, double start_s,
                                   bool apart);

}  // namespace kinescope
