// SPDX-License-Identifier: Apache-2.0
//
// RunSummaries made by hand, for the report's tests: the kinematics and the residuals are real, the
// uncertainties are plausible.
#pragma once

#include <string>
#include <string_view>

#include "app/report/run_summary.h"

namespace kinescope {

struct SyntheticRunOptions {
  MeasurementKind kind = MeasurementKind::kCorners;
  int frames = 300;
  double gear_error_rad = 0.0;  ///< amplitude, once per turn, of the second joint
  bool log = true;              ///< false: joint values are estimates, no channel
  bool nominal = false;         ///< a nominal robot in place of a structure
  std::string robot = "bench_arm";
  std::string second_channel = "q2";
};

/// A chain of turn, turn, slide with a marker on the base and on each link.
[[nodiscard]] RunSummary synthetic_run(const SyntheticRunOptions& options = {});

[[nodiscard]] inline bool has(std::string_view text, std::string_view part) {
  return text.find(part) != std::string_view::npos;
}

}  // namespace kinescope
