// SPDX-License-Identifier: Apache-2.0
//
// Takes   a joint log.
// Gives   readings that may be wrong, since no others of their channel are near: a proposal, which
//         whoever knows more has to judge.
#pragma once

#include <string>
#include <vector>

#include "kinematics/log/joint_log.h"

namespace kinescope {

struct ReadingApart {
  std::size_t row = 0;
  int channel = 0;
};

/// Readings each of which alone makes half of its channel's range or more, those beyond it left
/// out: at most three of a channel, the furthest first. By row. O(channels * samples log samples).
[[nodiscard]] std::vector<ReadingApart> readings_apart(const JointLog& log);

/// "FILE: at t = 1.2 'q1' reads 17.5, which none of its other readings comes near".
[[nodiscard]] std::string words_of(const JointLog& log, const ReadingApart& reading);

/// The log with what lies between the readings before and after in place of these.
[[nodiscard]] JointLog without_readings(JointLog log, const std::vector<ReadingApart>& apart);

}  // namespace kinescope
