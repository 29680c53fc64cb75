// SPDX-License-Identifier: Apache-2.0
//
// Takes   a Calibration with held-out errors.
// Gives   the one frame that a fit without it predicts worse than all the others together: it alone
//         shows something of the robot, or what was read or measured in it is wrong.
// Why     such a frame bends the fit to itself: it leaves no residual, and no outlier test sees it
//         (a point of high leverage; Belsley, Kuh and Welsch 1980, section 2.1).
#pragma once

#include <optional>

#include "calib/bundle/calibration.h"
#include "calib/quality/error_summary.h"

namespace kinescope {

struct LonePosture {
  double time_s = 0.0;  ///< of the frame
  ErrorRow of_it;       ///< held out
  ErrorRow of_others;   ///< the same
};

/// Nothing where the errors are spread, or nothing was held out.
[[nodiscard]] std::optional<LonePosture> lone_posture(const Calibration& calibration);

}  // namespace kinescope
