// SPDX-License-Identifier: Apache-2.0
//
// What of a recording is not used, in words, before anything is fitted: markers without a size, and
// frames without readings.
#pragma once

#include <string>
#include <vector>

#include "calib/camera/tag_observations.h"
#include "kinematics/log/joint_log.h"

namespace kinescope {

/// Markers that are seen again and again and that tags.yaml does not list: one sentence for all of
/// them.
[[nodiscard]] std::vector<std::string> unlisted_marker_words(const TagObservations& tags);

/// More than a fifth of the frames (at `times_s`) lie outside the log's time or in its gaps: one
/// sentence.
[[nodiscard]] std::vector<std::string> uncovered_words(const JointLog& log,
                                                       const std::vector<double>& times_s);

}  // namespace kinescope
