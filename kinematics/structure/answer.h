// SPDX-License-Identifier: Apache-2.0
//
// Takes   a clean series and the log.
// Gives   the tree that explains it, in natural units, with the columns that the markers follow
//         best and the smallest allowance for errors that are no noise.
#pragma once

#include "kinematics/structure/own_log.h"
#include "kinematics/structure/search.h"

namespace kinescope::structure_search {

/// Instants the search looks at; averages of the frames around them.
inline constexpr int kInstants = 240;

struct Answer {
  FoundTree found;
  Series full;  ///< with the allowance
  Series thin;
  double allowance = 0.0;  ///< share of the distance to the camera, and rad
};

/// The best tree with these sightings and this log, copies and all.
[[nodiscard]] Answer answer_with(Series full, double allowance, const JointLog& log,
                                 const StructureOptions& options,
                                 UnseenLinks unseen = UnseenLinks::kWhereNeeded);

/// `own`: the columns that it was found with.
[[nodiscard]] Answer find_answer(Series full, const JointLog& log, const StructureOptions& options,
                                 OwnLog& own);

/// How many channels drive joints.
[[nodiscard]] std::size_t used_channels(const GrownTree& tree);

/// Every body hangs by joints that channels drive, each by its own or one that plainly drives
/// several.
[[nodiscard]] bool is_whole(const GrownTree& tree, const Readings& readings);

}  // namespace kinescope::structure_search
