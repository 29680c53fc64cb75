// SPDX-License-Identifier: Apache-2.0
//
// Takes   a joint log.
// Gives   readings that may be wrong, since no others of their channel are near, or none of those
//         before and after: a proposal, which whoever knows more has to judge.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "kinematics/log/joint_log.h"

namespace kinescope {

struct ReadingApart {
  std::size_t row = 0;
  int channel = 0;
  bool in_range = false;  ///< of the others of its channel
};

/// Readings each of which alone makes half of its channel's range or more, those beyond it left
/// out: at most three of a channel, the furthest first. And spikes, at most one in ten of a
/// channel: further from the median of the seven readings about them than the largest step between
/// the others leads, which no motion that these show is; with the rest of a row that is mostly so.
/// By row. O(channels * samples log samples).
[[nodiscard]] std::vector<ReadingApart> readings_apart(const JointLog& log);

/// By channel where there are many, each alone where there are few.
[[nodiscard]] std::vector<std::vector<ReadingApart>> told_together(
    const std::vector<ReadingApart>& apart);

/// "FILE: at t = 1.2 'q1' reads 17.5, which none of its other readings comes near". `readings`: of
/// one channel, at least one.
[[nodiscard]] std::string words_of(const JointLog& log, std::span<const ReadingApart> readings);

/// The log with what lies between the readings before and after in place of these.
[[nodiscard]] JointLog without_readings(JointLog log, const std::vector<ReadingApart>& apart);

}  // namespace kinescope
