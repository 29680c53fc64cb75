// SPDX-License-Identifier: Apache-2.0
//
// Takes   one grey image and what the board should look like.
// Gives   the board's points in it with their places on the board; and a test that the layout is
// the declared one. Frame   board: x right, y down from its top left corner, z into it, m.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/vision/board.h"
#include "calib/vision/image_view.h"

namespace kinescope {

/// A marker of the board as detected: lb, rb, rt, lt.
struct BoardMarker {
  int id = 0;
  std::vector<Eigen::Vector2d> pixels;
  bool refined = false;  ///< corners to a tenth of a pixel; otherwise to one
};

/// One view of a board. Points and places correspond.
struct BoardSight {
  std::vector<Eigen::Vector2d> pixels;
  std::vector<Eigen::Vector3d> places_m;
  std::vector<BoardMarker> markers;  ///< ChArUco and AprilGrid
};

class BoardFinder {
 public:
  virtual ~BoardFinder() = default;
  /// Empty when there is no board in the image.
  [[nodiscard]] virtual BoardSight find(const ImageView& image) = 0;
  /// Completes what needs all views. Gives warnings; throws bad_input when the layout does not fit.
  virtual std::vector<std::string> settle(std::vector<BoardSight>& sights,
                                          const std::string& source) const = 0;
};

/// Throws bad_request for a board that makes no sense.
[[nodiscard]] std::unique_ptr<BoardFinder> make_board_finder(const BoardSpec& board);

/// Places of a ChArUco board's marker corners; nothing for an id that is not on it.
[[nodiscard]] std::optional<std::vector<Eigen::Vector3d>> charuco_marker_places(
    const BoardSpec& board, bool legacy, int id);

/// RMS distance (px) of points from where the plane's homography puts them; 0 below five points.
[[nodiscard]] double plane_misfit_px(const std::vector<Eigen::Vector3d>& places_m,
                                     const std::vector<Eigen::Vector2d>& pixels);

}  // namespace kinescope
