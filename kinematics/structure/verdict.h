// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grown tree with everything that was looked at beside it.
// Gives   how probable the whole is, what the next best would be, and what the recording cannot
// decide.
#pragma once

#include "kinematics/structure/growth.h"
#include "kinematics/structure/structure.h"

namespace kinescope::structure_search {

/// An answer that cannot be ruled out: a body that hangs elsewhere.
struct RivalPlace {
  std::string words;
  std::string instead_of;  ///< where the answer has the body, in words
  std::size_t body = 0;
  Attachment attachment;
};

struct Verdict {
  double probability = 0.0;
  double runner_up_log_odds = 0.0;
  std::string runner_up;
  std::vector<double> link_log_odds;  ///< of every link's joint; 0 for the camera's
  std::vector<std::string> link_runner_up;
  std::vector<StructureDoubt> doubts;
  std::vector<RivalPlace> rivals;  ///< the closest first
  StructureStatus status = StructureStatus::kNotRun;
};

[[nodiscard]] Verdict judge(const GrownTree& tree, const Series& series, const Readings& readings,
                            const JointLog& log, const StructureOptions& options);

/// What the recording does not tell the answer from.
[[nodiscard]] StructureDoubt rival_doubt(const std::string& rival);

/// "tag 3", or "the camera" for link 0.
[[nodiscard]] std::string link_words(const GrownTree& tree, const Series& series, int link);

}  // namespace kinescope::structure_search
