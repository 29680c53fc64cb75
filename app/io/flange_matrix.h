// SPDX-License-Identifier: Apache-2.0
//
// Poses that a log of the flange holds as rotation matrices or homogeneous ones.
#pragma once

#include <optional>
#include <string>

#include "kinematics/core/csv.h"

namespace kinescope {

/// Columns of one name with two numbers (T00 .. T33, r11 .. r33) or one (m0 .. m15): 16 or 12 of
/// them a homogeneous matrix (the last row left out), 9 beside x, y, z its rotation. They become
/// the columns x, y, z, qx, qy, qz, qw, at the end. Of 12 and 16 the numbers show whether they
/// stand row by row, as usual, or column by column: where the rotation is one, and which the last
/// row is. Gives the reading in words; nothing where there are no such columns. A row that holds no
/// rotation gets no quaternion. Throws bad_input where most rows hold none, read either way.
[[nodiscard]] std::optional<std::string> matrix_to_quaternion(CsvTable& table);

}  // namespace kinescope
