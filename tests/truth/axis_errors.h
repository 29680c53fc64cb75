// SPDX-License-Identifier: Apache-2.0
//
// How far estimated axes are from the true ones.
#pragma once

#include <optional>
#include <vector>

#include "calib/bundle/calibration.h"

namespace kinescope::truth {

struct AxisDifference {
  double direction_rad = 0.0;
  std::optional<double> position_m;  ///< revolute joints
};

/// One a joint, at the calibration's mean joint values. In the base that the first marker of either
/// tree gives; and among the axes: after the motion that brings all axes nearest to the true
/// ones, an angle counting as much as a shift of as many times the extent of the robot (root mean
/// square of the turning axes' origins about their middle, at least 0.1 m).
struct AxisDifferences {
  std::vector<AxisDifference> in_base, among;
};

[[nodiscard]] AxisDifferences axis_differences(const KinematicTree& truth,
                                               const Calibration& found);

}  // namespace kinescope::truth
