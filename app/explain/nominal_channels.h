// SPDX-License-Identifier: Apache-2.0
//
// Takes   a nominal robot and the recording's joint log.
// Gives   the robot with the column that drives each joint; what had to be assumed, in words.
// Method  by name; where no column is named like a joint, in order; a joint that mimics another
//         takes that one's column. A joint without a column is held at 0, as long as nothing that
//         the log moves lies beyond it and no moving column could be its own.
#pragma once

#include <string>
#include <vector>

#include "app/io/recording.h"
#include "kinematics/structure/structure.h"

namespace kinescope {

struct NominalChannels {
  KinematicTree tree;
  std::vector<std::string> warnings;
  bool in_order = false;  ///< no column is named like a joint
  /// There are more columns than joints, too: which ones drive the joints, only markers show.
  bool of_more = false;
};

/// Throws bad_input, naming joints and columns, where a column is missing or belongs to no joint.
[[nodiscard]] NominalChannels match_channels(const Recording& recording);

/// Throws bad_input where nothing has shown which of more columns than joints drive the joints.
void require_columns_known(const NominalChannels& matched, const JointLog& log);

/// The same with the columns that the markers show to move the joints, first to last, of a robot
/// that is one chain as the structure is, with joints of the same kinds; as it is otherwise.
[[nodiscard]] NominalChannels by_motion(NominalChannels matched, const Structure& structure,
                                        const JointLog& log);

/// Throws undetermined where the markers show that the channel of a joint turns what is drawn as
/// sliding, or the other way round. Says nothing of a structure that is not determined.
void require_drawn_types(const NominalChannels& matched, const Structure& structure,
                         const Recording& recording);

}  // namespace kinescope
