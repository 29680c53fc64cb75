// SPDX-License-Identifier: Apache-2.0
//
// Takes   a joint log.
// Gives   the rows from which on columns stand in each other's place, or one with its sign turned:
//         a proposal, which whoever knows more has to judge.
// Method  channels that jump at one row as no motion does, each to where another one was, or to
//         where it was itself on the other side of zero.
// Not here: columns exchanged from the first row on, which a log alone does not show; what shows in
//         the joints (calib/quality/partly_followed.h).
#pragma once

#include <string>
#include <vector>

#include "kinematics/log/joint_log.h"
#include "kinematics/log/readings_apart.h"

namespace kinescope {

/// What goes on as a channel.
struct GoesOnAs {
  int channel = 0;    ///< index into JointLog::channels
  int column = 0;     ///< of the log from `row` on
  double sign = 1.0;  ///< of that column
};

/// From `row` on: each of `readings` another column, or the same with its sign turned.
struct ExchangedReadings {
  std::size_t row = 0;
  std::vector<GoesOnAs> readings;
};

/// By row, each one as the log is with those before it mended. `apart`: readings_apart(log), which
/// jump by themselves. O(channels * samples log samples).
[[nodiscard]] std::vector<ExchangedReadings> exchanged_readings(
    const JointLog& log, const std::vector<ReadingApart>& apart);

/// As it would be without.
[[nodiscard]] JointLog with_exchanged_back(JointLog log,
                                           const std::vector<ExchangedReadings>& exchanged);

/// "FILE: from t = 12.05 on 'j2' goes on as 'j3', 'j3' goes on as 'j2'".
[[nodiscard]] std::string words_of(const JointLog& log, const ExchangedReadings& exchanged);

}  // namespace kinescope
