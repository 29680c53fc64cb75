// SPDX-License-Identifier: Apache-2.0
//
// Takes   a clean series, thinned, and the log.
// Gives   the tree that explains it best, over all offsets between the two clocks.
// Method  clocks that agree are tried first; where that leaves more than noise, the scan's likely
//         offsets are starts too. At each a tree is grown, on few instants first, the offset
//         refined on that tree's likelihood, and the tree grown again where the offset moved. The
//         likelihoods of the trees decide, since a scan of pairs may well have its minimum
//         elsewhere.
#pragma once

#include "kinematics/structure/growth.h"
#include "kinematics/structure/refine_offset.h"
#include "kinematics/structure/structure.h"

namespace kinescope::structure_search {

struct FoundTree {
  GrownTree tree;
  Readings readings;  ///< at the offset
  TimeOffset offset;
};

/// Joints in series without markers between them: a search a hundred times as long as that for
/// single joints.
enum class UnseenLinks { kNone, kWhereNeeded };

[[nodiscard]] FoundTree search_tree(const Series& full, const Series& thin, const JointLog& log,
                                    const StructureOptions& options, UnseenLinks unseen);

/// Something that several joints in series may explain better.
[[nodiscard]] bool is_unfinished(const FoundTree& found);

/// Every channel that moves drives a joint.
[[nodiscard]] bool uses_all(const FoundTree& found);

}  // namespace kinescope::structure_search
