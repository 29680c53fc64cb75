// SPDX-License-Identifier: Apache-2.0
//
// The offset between the frames' clock and the log's, before any structure is known.
#pragma once

#include <vector>

#include "kinematics/structure/readings.h"

namespace kinescope::structure_search {

/// A fraction of the time in which the fastest channel changes.
[[nodiscard]] double offset_step(const Readings& readings);

/// Offsets worth a structure each, best first, 0 among them: minima of a likelihood over offsets
/// within `half_width_s`, in which bodies hang on each other as a tree of single joints. Cost
/// O(bodies^2 * channels * offsets).
[[nodiscard]] std::vector<double> scan_time_offsets(const Series& series, const JointLog& log,
                                                    double step_s, double half_width_s,
                                                    double max_gap_s);

}  // namespace kinescope::structure_search
