// SPDX-License-Identifier: Apache-2.0
//
// Takes   a bag with joint states.
// Gives   the tables that a joint log and a torque log are read from, as if somebody had written
//         them.
// Units   t in s after the bag's first message; values as published (rad, m, N m).
// Method  One topic and set of joints is the log (bags::choose_joints); joints of other names that
//         others publish (a second arm, a gripper) are interpolated at its stamps, where they cover
//         nine tenths of it. Nothing of topics of commands is.
#pragma once

#include <string>
#include <vector>

#include "kinematics/bags/bag.h"
#include "kinematics/core/csv.h"
#include "kinematics/log/channel_table.h"

namespace kinescope::bags {

/// The table of a joint log, and what was wrong with the bag that it is from.
struct LogTable {
  CsvTable table;  ///< source "FILE:/topic", lines the rows, from 1
  std::vector<std::string> warnings;
};

/// t, then one column a joint by its name, then tau_JOINT where efforts are published. Throws as
/// open() and choose_joints().
[[nodiscard]] LogTable joint_table(const Source& source);
/// t, then JOINT_position, JOINT_velocity and JOINT_effort of every joint.
[[nodiscard]] ChannelTable channel_table(const Source& source);

/// The columns of a torque log that hold a channel of the joint log and its torque.
struct TorqueColumns {
  std::string position, torque;
};
[[nodiscard]] TorqueColumns torque_columns(const std::string& channel, const std::string& torque);

}  // namespace kinescope::bags
