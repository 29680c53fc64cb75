// SPDX-License-Identifier: Apache-2.0
//
// Takes   the axes of a robot as it was found, its values counted from zeros and in directions of
//         its own (encoder ticks), and the same axes as they are drawn at zero.
// Gives   what the found values are as values of the drawn joints.
// Method  all directions are tried; in those that fit the drawing, the angles between successive
//         common normals (of joints that slide the offsets between them) are compared
//         (axis_geometry.h).
#pragma once

#include <span>
#include <vector>

#include "kinematics/model/axis_geometry.h"

namespace kinescope {

/// drawn value = direction * found value + zero.
struct ValueOnDrawing {
  double direction = 1.0;       ///< 1 or -1
  bool direction_told = false;  ///< the other one fits the drawing worse
  double zero = 0.0;            ///< rad, m
  bool zero_told = false;       ///< of the first joint and the last no axes tell
};

/// `found` at values of zero, `drawn` in the same order with the same parents; `is_open`: of which
/// the direction is asked for, the others count as drawn. At most 16 of these, or none is told. One
/// an axis.
[[nodiscard]] std::vector<ValueOnDrawing> values_on_drawing(std::span<const PlacedAxis> found,
                                                            std::span<const PlacedAxis> drawn,
                                                            const std::vector<bool>& is_open);

}  // namespace kinescope
