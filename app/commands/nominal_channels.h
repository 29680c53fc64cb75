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

namespace kinescope {

struct NominalChannels {
  KinematicTree tree;
  std::vector<std::string> warnings;
};

/// Throws bad_input, naming joints and columns, where a column is missing or belongs to no joint.
[[nodiscard]] NominalChannels match_channels(const Recording& recording);

}  // namespace kinescope
