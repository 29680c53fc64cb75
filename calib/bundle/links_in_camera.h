// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "calib/bundle/calibration.h"

namespace kinescope::bundle {

/// Links in the (reference) camera's frame, effects apart: one list a frame; empty where a joint
/// value, or where a camera that moves is, is unknown.
[[nodiscard]] std::vector<std::vector<Pose>> links_in_camera(const Calibration& calibration);

}  // namespace kinescope::bundle
