// SPDX-License-Identifier: Apache-2.0
//
// In which order a robot's joints stand in its log.
#pragma once

#include <vector>

#include "kinematics/log/joint_log.h"

namespace kinescope {

/// The place of every channel: by the numbers in their names where those differ by numbers alone
/// ("joint10" behind "joint2"), else as the columns stand.
[[nodiscard]] std::vector<std::size_t> channel_ranks(const JointLog& log);

}  // namespace kinescope
