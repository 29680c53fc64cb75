// SPDX-License-Identifier: Apache-2.0
//
// Takes   images or a video of a chessboard, ChArUco board or AprilGrid.
// Gives   intrinsics with uncertainties, coverage of the image, what was left out and why.
// Method  OpenCV's detectors and cv::calibrateCamera (Zhang 2000), for an equidistant lens our own
//         fit; standard deviations from the normal equations. A board whose layout does not fit is
//         refused.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "calib/camera/camera_model.h"
#include "kinematics/core/progress.h"

namespace kinescope {

enum class BoardType { kChessboard, kCharuco, kAprilGrid };

struct BoardSpec {
  BoardType type = BoardType::kChessboard;
  int columns = 0;  ///< chessboard: inner corners; ChArUco: squares; AprilGrid: tags
  int rows = 0;
  double square_m = 0.0;        ///< chessboard, ChArUco: edge of a square; AprilGrid: edge of a tag
  double marker_m = 0.0;        ///< ChArUco: edge of a marker
  double spacing = 0.3;         ///< AprilGrid: gap between tags as a fraction of the tag
  std::string dictionary;       ///< ChArUco dictionary or AprilGrid family
  bool legacy_charuco = false;  ///< layout of OpenCV before 4.6 (even row counts)
};

struct BoardView {
  std::string source;  ///< image file or "frame 12"
  int corners = 0;
  double rms_px = 0.0;
  bool used = false;
  std::string reason;  ///< why it was left out
};

struct IntrinsicCalibration {
  CameraModel camera;
  std::array<double, kMaxIntrinsics>
      sigma{};  ///< standard deviations: fx fy cx cy, then distortion
  double rms_px = 0.0;
  double held_out_rms_px = 0.0;  ///< views left out of the fit, pose only refitted
  std::vector<BoardView> views;
  double coverage = 0.0;             ///< share of a 10 x 8 grid of the image that saw a corner
  std::vector<int> coverage_counts;  ///< corners in each cell of that grid, row by row
  double tilt_range_deg = 0.0;       ///< spread of the board's tilt over the views
  std::vector<std::string> warnings;
};

struct BoardOptions {
  DistortionModel model = DistortionModel::kPlumbBob;
  bool fix_k3 = true;
  int max_views = 60;  ///< of a video: the most different views are kept
};

/// Throws bad_input: nothing readable, no board found, a layout that does not fit (with the
/// distance by which it misses), fewer than three usable views; undetermined when the views cannot
/// carry the model.
[[nodiscard]] IntrinsicCalibration calibrate_intrinsics(
    const std::filesystem::path& images_or_video, const BoardSpec& board,
    const BoardOptions& options = {}, const Progress& progress = {});

}  // namespace kinescope
