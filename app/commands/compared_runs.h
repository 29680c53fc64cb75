// SPDX-License-Identifier: Apache-2.0
//
// Finished runs, read back from their folders, and what differs between them: the robot's numbers
// (calib/quality/robot_difference.h) and the effects that tracing found at its joints.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/io/effects_file.h"
#include "app/io/trace_file.h"
#include "app/report/compare_summary.h"
#include "calib/bundle/calibration.h"

namespace kinescope {

struct StoredRun {
  std::filesystem::path folder;
  std::string name;       ///< the folder as it was named
  std::string recording;  ///< by run.json; empty: not known
  Calibration calibration;
  CalibratedEffects effects;
  std::optional<StoredTrace> trace;  ///< none: the run did not trace
};

/// Throws bad_input (no folder, no calibration.json, one that is damaged, of another version or
/// another program), undetermined (a calibration that did not converge).
[[nodiscard]] StoredRun read_stored_run(const std::filesystem::path& folder);

/// The joints of the first run in each (its own the first). Throws bad_input where one is another
/// robot's.
[[nodiscard]] std::vector<RobotMatch> match_runs(std::span<const StoredRun> runs);

/// Of runs 2, 3, .. against the first; p-values are corrected over all of them together.
[[nodiscard]] std::vector<RunDifference> run_differences(std::span<const StoredRun> runs,
                                                         std::span<const RobotMatch> matches,
                                                         double level);

}  // namespace kinescope
