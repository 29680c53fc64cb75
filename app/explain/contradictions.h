// SPDX-License-Identifier: Apache-2.0
//
// Takes   an explanation, and the evidence it is of.
// Gives   what of the evidence contradicts it and is no error of the robot: a channel that is a
//         joint's for a part of the recording, stretches of a log that froze or came late, a marker
//         that came off; each with the evidence that is without that.
// Method  one file of calib/quality for each.
// Not here: whether the evidence or the explanation is wrong (explain.cpp).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/explain/changed_evidence.h"

namespace kinescope {

struct Contradiction {
  std::optional<ChangedEvidence> without_it;  ///< none: it can only be told
  bool is_no_error_of_robot = false;          ///< none looks so: to leave nothing is enough
  std::vector<std::string> words_if_taken;    ///< for a user
  std::vector<std::string> words_if_kept;
};

/// Asks `options` for explanations of parts of the evidence, where it has to.
using FindContradiction = std::optional<Contradiction>(const Explanation& now,
                                                       const Evidence& evidence,
                                                       const ExplainOptions& options);

[[nodiscard]] FindContradiction joints_followed_in_parts;
[[nodiscard]] FindContradiction stretches_of_a_wrong_log;
[[nodiscard]] FindContradiction markers_that_came_off;
/// Which therefore seem to move with no joint. Explains halves of the evidence.
[[nodiscard]] FindContradiction free_markers_that_came_off;

}  // namespace kinescope
