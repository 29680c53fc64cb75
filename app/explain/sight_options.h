// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "calib/bundle/calibrate.h"
#include "calib/vision/detect.h"

namespace kinescope {

/// How markers are looked for, and what is estimated from them.
struct SightOptions {
  DetectOptions detect;
  CalibrateOptions calibrate;
  /// Of the robot; none: all of it, and of a nominal robot what predicts unseen postures best.
  std::optional<FreeGeometry> free;
  bool estimate_intrinsics = false;
};

}  // namespace kinescope
