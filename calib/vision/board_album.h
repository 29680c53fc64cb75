// SPDX-License-Identifier: Apache-2.0
//
// Takes  a folder of photographs or a video of a board.
// Gives  what was seen of the board in each, and which views are worth calibrating from.
// Units  px.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/vision/board.h"
#include "calib/vision/board_points.h"

namespace kinescope {

inline constexpr int kMinBoardViews = 3;

/// Every view of the source, those without a board too.
struct BoardAlbum {
  int width = 0;
  int height = 0;
  std::vector<BoardView> views;
  std::vector<BoardSight> sights;  ///< as views
  std::vector<std::string> warnings;
};

/// Of a folder's images, or of a video's frames, evenly chosen. Throws bad_input for images of
/// different sizes, or none.
[[nodiscard]] BoardAlbum read_album(const std::filesystem::path& images_or_video,
                                    BoardFinder& finder, const Progress& progress);

/// Indices of the views to calibrate from, at most `options.max_views`, the most different ones;
/// the other views get their reason. Throws bad_input where there are too few.
[[nodiscard]] std::vector<std::size_t> usable_views(BoardAlbum& album, const BoardOptions& options,
                                                    const std::string& source);

}  // namespace kinescope
