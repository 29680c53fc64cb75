// SPDX-License-Identifier: Apache-2.0
//
// The offset between the frames' clock and the log's, before any structure is known.
#pragma once

#include <vector>

#include "kinematics/log/joint_log.h"
#include "kinematics/structure/series.h"

namespace kinescope::structure_search {

struct OffsetScan {
  double step_s = 0.0;         ///< of the scan: a fraction of the time in which channels change
  std::vector<double> likely;  ///< offsets worth a structure each, best first, 0 among them
};

/// Minima of a likelihood over offsets within `half_width_s`, in which bodies hang on each other
/// as a tree of single joints. Cost O(bodies^2 * channels * offsets).
[[nodiscard]] OffsetScan scan_time_offsets(const Series& series, const JointLog& log,
                                           double half_width_s, double max_gap_s);

}  // namespace kinescope::structure_search
