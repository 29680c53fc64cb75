// SPDX-License-Identifier: Apache-2.0
//
// Takes  the views that a lens was calibrated from.
// Gives  how well they cover the image and the board's directions, and what to do better, in words.
#pragma once

#include <vector>

#include "calib/vision/board.h"
#include "calib/vision/board_album.h"
#include "calib/vision/board_fit.h"

namespace kinescope {

/// Fills `coverage_counts` and `coverage`.
void count_coverage(const BoardAlbum& album, const std::vector<std::size_t>& used,
                    IntrinsicCalibration& result);

/// Largest angle between the boards' normals, degrees.
[[nodiscard]] double tilt_range_deg(const std::vector<ViewFit>& fits);

/// Appends a line to `warnings` for each thing that limits the calibration. `used`: number of
/// views.
void add_board_warnings(IntrinsicCalibration& result, int used);

}  // namespace kinescope
