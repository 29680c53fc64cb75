// SPDX-License-Identifier: Apache-2.0
//
// What a joint log tells against itself: stretches in which one row is repeated, and a clock that
// jumps while the joints do not.
#pragma once

#include <vector>

#include "kinematics/log/joint_log.h"

namespace kinescope {

/// Rows that are all the same, from the first to the last of them.
struct RepeatedStretch {
  double from_s = 0.0;
  double to_s = 0.0;
};

/// Stretches of at least `shortest_s` in which no channel changes, of a log in which channels do. A
/// robot at rest before noise-free encoders looks the same: what else was measured has to tell.
[[nodiscard]] std::vector<RepeatedStretch> repeated_stretches(const JointLog& log,
                                                              double shortest_s);

/// The log without the rows between the first and the last of each stretch.
[[nodiscard]] JointLog without_stretches(JointLog log,
                                         const std::vector<RepeatedStretch>& stretches);

/// Stamps behind `after_s` are later by `by_s` than the joints' motion says.
struct ClockJump {
  double after_s = 0.0;
  double by_s = 0.0;
};

/// Gaps of more than kMaxGap / 2 and ten usual steps, over which every channel moves no farther
/// than over a few usual steps, although one of them is as fast behind the gap as before. Not
/// between episodes (joined_at_s).
[[nodiscard]] std::vector<ClockJump> clock_jumps(const JointLog& log);

}  // namespace kinescope
