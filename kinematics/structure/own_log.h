// SPDX-License-Identifier: Apache-2.0
//
// Takes   a joint log with columns that tell the same.
// Gives   the log without copies, as the search sees it, and a Structure in the whole log's numbers
//         again.
#pragma once

#include <vector>

#include "kinematics/structure/copied_channels.h"
#include "kinematics/structure/structure.h"

namespace kinescope::structure_search {

/// The log without the columns that repeat others.
struct OwnLog {
  JointLog log;
  std::vector<int> channels;         ///< of the whole log
  std::vector<SameQuantity> groups;  ///< of the whole log
  std::vector<int> chosen;           ///< of each group
};

[[nodiscard]] OwnLog own_log(const JointLog& log, std::vector<SameQuantity> groups,
                             std::vector<int> chosen);
/// With the first of each group that is no command by its name (is_commanded()).
[[nodiscard]] OwnLog own_log(const JointLog& log, std::vector<SameQuantity> groups);

/// Channels of the log without copies become those of the whole log; copies of such that drive a
/// joint are listed, exact ones or not, the others are idle.
void in_whole_log(const OwnLog& own, const JointLog& log, Structure& out);

}  // namespace kinescope::structure_search
