// SPDX-License-Identifier: Apache-2.0
//
// What the finders of boards with markers share.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "calib/vision/board_points.h"
#include "calib/vision/refine_corners.h"
#include "calib/vision/tag_detector.h"

namespace kinescope {

// Marker corners may miss the plane by this share of a square (lens distortion bends the plane's
// homography); another layout misses by about half a square.
inline constexpr double kMaxMisfit = 0.15;

/// How far (px, RMS) corners may miss the board for a wrong size on it: below, a print or a ruler
/// may be to blame. `edge_px` is a square's edge, of an AprilGrid a tag's.
[[nodiscard]] inline double max_size_misfit_px(double edge_px) {
  constexpr double kShare = 0.03;
  constexpr double kLeast_px = 1.0;
  return std::max(kLeast_px, kShare * edge_px);
}

/// Markers of the image with refined corners; an id that is there twice is left out.
[[nodiscard]] std::vector<BoardMarker> find_board_markers(TagDetector& detector,
                                                          const TagLayout& layout,
                                                          const ImageView& image);

[[nodiscard]] std::unique_ptr<BoardFinder> make_april_grid_finder(const BoardSpec& board);

}  // namespace kinescope
