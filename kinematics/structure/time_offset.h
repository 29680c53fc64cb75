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

/// A clock that runs fast or slow against the other.
struct ClockRate {
  double rate = 1.0;  ///< joint-log time = first frame + rate * (frame time - first frame) + offset
  double offset_s = 0.0;
};

/// Over so long, from the first instant, rates are looked for, s.
inline constexpr double kRatePart = 40.0;

/// Rates between 0.8 and 1.25, but for those near 1, that are clearly likelier than 1, most likely
/// first; from the first kRatePart of the series.
[[nodiscard]] std::vector<ClockRate> scan_clock_rates(const Series& series, const JointLog& log,
                                                      double step_s, double half_width_s,
                                                      double max_gap_s);

/// The log by a clock that runs so: rate and offset 1 and 0 against the frames'.
[[nodiscard]] JointLog with_clock(JointLog log, const ClockRate& clock, double first_frame_s);

/// The series up to so long after its first instant.
[[nodiscard]] Series first_part(const Series& series, double length_s);

}  // namespace kinescope::structure_search
