// SPDX-License-Identifier: Apache-2.0
//
// Takes   a LeRobot dataset with observation.state.
// Gives   the tables that a joint log and a torque log are read from, as if somebody had written
//         them.
// Units   t in s after the first frame of the first episode; values as recorded: LeRobot does not
//         say whether they are rad, deg or per cent of a joint's range.
// Method  Elements of observation.state are joints by their names; ".pos", ".vel", ".torque" and
//         ".current" say which quantity. observation.velocity, .effort and .current are taken with
//         them, and of action what is called as a joint is its command.
#pragma once

#include <string>
#include <vector>

#include "kinematics/core/csv.h"
#include "kinematics/datasets/dataset.h"
#include "kinematics/log/channel_table.h"

namespace kinescope::datasets {

/// What an element of a feature is of its joint.
enum class Quantity { kPosition, kVelocity, kEffort, kCurrent, kCommand };

/// Signals of the chosen episodes, joined.
struct JointSignals {
  struct Signal {
    std::string joint;  ///< "shoulder_pan"
    Quantity quantity = Quantity::kPosition;
    std::vector<double> values;
  };
  std::string source;                 ///< "FOLDER:0-9"
  std::vector<double> times_s;        ///< strictly increasing
  std::vector<std::size_t> episodes;  ///< of each row
  std::vector<Signal> signals;        ///< in the order of the dataset
  std::vector<std::string> warnings;
};

/// Throws bad_input: no observation.state, rows of another length than declared, an episode of
/// other rows than listed, stamps that do not increase; as parquet::File.
[[nodiscard]] JointSignals read_signals(const Source& source);

/// The first stamps of all episodes but the first.
[[nodiscard]] std::vector<double> joined_at_s(const JointSignals& signals);

/// t, a column a joint by its name, JOINT_command, tau_JOINT (efforts, else currents).
[[nodiscard]] CsvTable joint_table(const JointSignals& signals);
/// t, episode, JOINT_position, JOINT_velocity, JOINT_effort, JOINT_current,
/// JOINT_position_command.
[[nodiscard]] ChannelTable channel_table(const JointSignals& signals);

/// The columns of channel_table() that hold a column of joint_table() and the torque "tau_JOINT".
struct TorqueNames {
  std::string position, torque;
};
[[nodiscard]] TorqueNames torque_names(const Source& source, const std::string& channel,
                                       const std::string& torque);

}  // namespace kinescope::datasets
