// SPDX-License-Identifier: Apache-2.0
//
// Takes   the folder of a finished run.
// Gives   the robot as a plan needs it: what it knows and does not (calib/design/planned_robot.h),
//         what its joints may do, how its markers are found, which effects are rivals.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "app/commands/commands.h"
#include "calib/design/plan.h"

namespace kinescope {

struct PlannedRun {
  design::PlannedRobot robot;
  design::JointSpace space;
  std::vector<std::pair<std::size_t, std::size_t>> rivals;  ///< of robot.effects, robot.rivals
  std::map<std::string, double> unit_factors;               ///< as CalibratedEffects
  double frame_rate_hz = 0.0;
  bool of_postures = false;    ///< the run's recording
  bool speeds_known = false;   ///< else a motion has no limits to keep to
  std::string speeds_unknown;  ///< why
  std::vector<std::string> warnings;
};

/// Throws bad_input (what read_stored_run() throws; a run of poses or points, or of a camera that
/// moves; limits of another robot), undetermined (no covariance).
[[nodiscard]] PlannedRun read_planned_run(const PlanCommandOptions& options);

}  // namespace kinescope
