// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calib/bundle/calibration.h"

namespace kinescope {

/// The frame of this joint was estimated, not held.
[[nodiscard]] bool is_axis_estimated(const Calibration& calibration, const Joint& joint);

/// The joints that were estimated, where no uncertainty could be given for the axis of any: the
/// data do not determine the robot. Empty where one is known.
[[nodiscard]] std::vector<std::string> unknown_axes(const Calibration& calibration);

}  // namespace kinescope
