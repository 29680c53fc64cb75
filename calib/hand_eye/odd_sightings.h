// SPDX-License-Identifier: Apache-2.0
//
// Markers that contradict the others of their frame: false or badly seen ones. Internal to the
// room.
#pragma once

#include "calib/hand_eye/fit.h"

namespace kinescope::hand_eye {

struct CleanedData {
  Data data;
  int left_out = 0;  ///< sightings
};

/// The data of a fit without sightings that are off by more than `sigma` of what the frame's others
/// and the median over all sightings say. Frames with fewer than three targets are left as they
/// are: of two none can be told wrong.
[[nodiscard]] CleanedData without_odd_sightings(const Model& model, const Fit& fit, double sigma);

}  // namespace kinescope::hand_eye
