// SPDX-License-Identifier: Apache-2.0
//
// What the finders of boards with markers share.
#pragma once

#include <memory>
#include <vector>

#include "calib/vision/board_points.h"
#include "calib/vision/refine_corners.h"
#include "calib/vision/tag_detector.h"

namespace kinescope {

// Marker corners may miss the plane by this share of a square (lens distortion bends the plane's
// homography); another layout misses by about half a square.
inline constexpr double kMaxMisfit = 0.15;

/// Markers of the image with refined corners; an id that is there twice is left out.
[[nodiscard]] std::vector<BoardMarker> find_board_markers(TagDetector& detector,
                                                          const TagLayout& layout,
                                                          const ImageView& image);

[[nodiscard]] std::unique_ptr<BoardFinder> make_april_grid_finder(const BoardSpec& board);

}  // namespace kinescope
