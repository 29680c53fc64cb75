// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/board.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/aruco.hpp>
#include <opencv2/imgcodecs.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/calib/vision/temporary_folder.h"
#include "tests/truth/render.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

constexpr double kSigmas = 4.5;       // of the claimed uncertainty; eight parameters a board
constexpr double kModelPixels = 0.3;  // px, what detectors of blurred corners add to the truth

BoardSpec chess(int columns, int rows, double square_m) {
  BoardSpec board;
  board.columns = columns;
  board.rows = rows;
  board.square_m = square_m;
  return board;
}

// A square picture of cells; `margin` white cells around it.
MarkerArt blank(int cells, int margin) {
  MarkerArt art{cells + 2 * margin, cells, {}};
  art.white.assign(static_cast<std::size_t>(art.total_cells * art.total_cells), true);
  return art;
}

void paint(MarkerArt& art, int x, int y, bool white) {
  art.white[static_cast<std::size_t>(y * art.total_cells + x)] = white;
}

void blacken(MarkerArt& art, int x0, int y0, int size) {
  for (int y = y0; y < y0 + size; ++y) {
    for (int x = x0; x < x0 + size; ++x) paint(art, x, y, false);
  }
}

MarkerArt chessboard(int squares) {
  MarkerArt art = blank(squares, 1);
  for (int r = 0; r < squares; ++r) {
    for (int c = 0; c < squares; ++c) paint(art, c + 1, r + 1, (r + c) % 2 == 1);
  }
  return art;
}

// Squares of 8 cells, markers of 6 in the white ones; `first` is the parity of column + row of
// these.
MarkerArt charuco(int squares, int first) {
  constexpr int kSquare = 8;
  constexpr int kMargin = 4;
  MarkerArt art = blank(squares * kSquare, kMargin);
  int id = 0;
  for (int r = 0; r < squares; ++r) {
    for (int c = 0; c < squares; ++c) {
      const int x0 = kMargin + c * kSquare;
      const int y0 = kMargin + r * kSquare;
      if ((r + c) % 2 != first) {
        blacken(art, x0, y0, kSquare);
        continue;
      }
      const MarkerArt marker =
          aruco_art(cv::aruco::DICT_4X4_50, id++);  // with one white cell around
      for (int y = 0; y < kSquare; ++y) {
        for (int x = 0; x < kSquare; ++x) paint(art, x0 + x, y0 + y, marker.at(x, y));
      }
    }
  }
  return art;
}

// Tags with `border` black cells around the code, gaps of 3 cells, ids row by row from the bottom
// left, black squares where gaps cross, as Kalibr prints them.
MarkerArt aprilgrid(int tags, int border) {
  constexpr int kGap = 3;
  const int edge = 6 + 2 * border;
  const int pitch = edge + kGap;
  MarkerArt art = blank(tags * pitch - kGap, kGap);
  for (int r = 0; r < tags; ++r) {
    for (int c = 0; c < tags; ++c) {
      const MarkerArt tag = apriltag_art("tag36h11", (tags - 1 - r) * tags + c);
      const int x0 = kGap + c * pitch;
      const int y0 = kGap + r * pitch;
      blacken(art, x0, y0, edge);
      for (int y = 0; y < 6; ++y) {
        for (int x = 0; x < 6; ++x) {
          paint(art, x0 + border + x, y0 + border + y, tag.at(x + 2, y + 2));
        }
      }
    }
  }
  for (int r = 0; r <= tags; ++r) {
    for (int c = 0; c <= tags; ++c) blacken(art, c * pitch, r * pitch, kGap);
  }
  return art;
}

class Board : public TemporaryFolder {
 protected:
  static CameraModel lens(DistortionModel model) {
    CameraModel camera = pinhole_guess(480, 360, 420.0);
    camera.fy = 424.0;
    camera.cx += 5.0;
    camera.cy -= 4.0;
    camera.model = model;
    if (model == DistortionModel::kEquidistant) {
      camera.distortion = {-0.02, 0.01, 0.0, 0.0};
    } else {
      camera.distortion = {-0.12, 0.05, 0.001, -0.0005};
    }
    return camera;
  }

  // Fourteen photographs from all sides.
  void photograph(const CameraModel& camera, const MarkerArt& art, double size_m,
                  double max_tilt_deg = 45.0, int count = 14) const {
    Rng rng = Rng::from_name("board photographs");
    for (int i = 0; i < count; ++i) {
      PlacedMarker board{art, {}, size_m};
      const double angle = 2.0 * std::numbers::pi * i / 7.0;
      const Eigen::Vector2d pixel(240.0 + 80.0 * std::cos(2.3 * i),
                                  180.0 + 50.0 * std::sin(1.7 * i));
      board.T_camera_tag =
          pose_showing(camera, pixel, i % 2 == 0 ? 190.0 : 230.0, size_m,
                       max_tilt_deg * (0.6 + 0.4 * (i % 3) / 2.0) * std::numbers::pi / 180.0, angle,
                       0.3 * rng.normal());
      const GreyImage image = render_markers(camera, {board}, {.supersample = 4}, rng);
      const cv::Mat picture(image.height, image.width, CV_8UC1,
                            const_cast<std::uint8_t*>(image.pixels.data()));
      ASSERT_TRUE(cv::imwrite((folder_ / fmt::format("{:02d}.png", i)).string(), picture));
    }
  }

  static void expect_close(const IntrinsicCalibration& found, const CameraModel& truth) {
    const auto within = [&](double value, double true_value, std::size_t index, const char* name) {
      EXPECT_NEAR(value, true_value, kSigmas * found.sigma[index] + kModelPixels) << name;
      EXPECT_GT(found.sigma[index], 0.0) << name;
      EXPECT_LT(found.sigma[index], 4.0) << name;
    };
    within(found.camera.fx, truth.fx, 0, "fx");
    within(found.camera.fy, truth.fy, 1, "fy");
    within(found.camera.cx, truth.cx, 2, "cx");
    within(found.camera.cy, truth.cy, 3, "cy");
    EXPECT_NEAR(found.camera.distortion[0], truth.distortion[0], kSigmas * found.sigma[4] + 0.002);
    EXPECT_LT(found.rms_px, 0.25);
    EXPECT_LT(found.held_out_rms_px, 1.5 * found.rms_px);
    EXPECT_GT(found.coverage, 0.25);
    EXPECT_GT(found.tilt_range_deg, 40.0);
    EXPECT_EQ(found.camera.width, 480);
    EXPECT_EQ(found.camera.height, 360);
  }

  std::string complaint(const BoardSpec& board, ExitCode code) const {
    try {
      (void)calibrate_intrinsics(folder_, board);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      return error.what();
    }
    return "no complaint";
  }
};

TEST_F(Board, ChessboardGivesTheLensBack) {
  const CameraModel camera = lens(DistortionModel::kPlumbBob);
  photograph(camera, chessboard(8), 0.2);
  const auto found = calibrate_intrinsics(folder_, chess(7, 7, 0.025));
  expect_close(found, camera);
  EXPECT_EQ(found.sigma[8], 0.0);  // k3 is held
  EXPECT_EQ(found.camera.distortion[4], 0.0);
}

TEST_F(Board, EquidistantLens) {
  const CameraModel camera = lens(DistortionModel::kEquidistant);
  photograph(camera, chessboard(8), 0.2);
  const auto found =
      calibrate_intrinsics(folder_, chess(7, 7, 0.025), {.model = DistortionModel::kEquidistant});
  expect_close(found, camera);
}

TEST_F(Board, CharucoOfBothLayoutsAndARefusalOfTheWrongOne) {
  const CameraModel camera = lens(DistortionModel::kPlumbBob);
  BoardSpec board{BoardType::kCharuco, 6, 6, 0.04, 0.03, 0.3, "DICT_4X4_50", false};
  for (const bool legacy : {false, true}) {
    // Six rows: the layouts differ.
    photograph(camera, charuco(6, legacy ? 0 : 1), 6 * 0.04);
    board.legacy_charuco = legacy;
    expect_close(calibrate_intrinsics(folder_, board), camera);
    board.legacy_charuco = !legacy;
    const std::string text = complaint(board, ExitCode::kBadInput);
    EXPECT_NE(text.find("miss the declared board"), std::string::npos) << text;
    EXPECT_NE(text.find("4.6"), std::string::npos) << text;
  }
  board.legacy_charuco = true;
  board.marker_m = 0.026;
  const std::string text = complaint(board, ExitCode::kBadInput);
  EXPECT_NE(text.find("edge is about 30.0 mm"), std::string::npos) << text;
}

TEST_F(Board, AprilGridsWithBothBorders) {
  const CameraModel camera = lens(DistortionModel::kPlumbBob);
  for (const int border : {1, 2}) {
    const int edge = 6 + 2 * border;
    const double cell = 0.004;
    photograph(camera, aprilgrid(3, border), (3 * (edge + 3) - 3) * cell);
    const BoardSpec board{BoardType::kAprilGrid, 3, 3, edge * cell, 0.0, 3.0 / edge, ""};
    expect_close(calibrate_intrinsics(folder_, board), camera);
  }
  const BoardSpec wrong{BoardType::kAprilGrid, 3, 3, 0.04, 0.0, 0.9, ""};
  EXPECT_NE(complaint(wrong, ExitCode::kBadInput).find("miss the declared grid"),
            std::string::npos);
}

// The lens' own error hides a wrong gap between the tags; neighbouring tags show it.
TEST_F(Board, TheSpacingOfAnAprilGridIsMeasured) {
  photograph(lens(DistortionModel::kPlumbBob), aprilgrid(3, 1), (3 * 11 - 3) * 0.004);
  BoardSpec board{BoardType::kAprilGrid, 3, 3, 0.032, 0.0, 3.0 / 8.0, ""};
  const auto says_gap = [](const std::string& text) {
    return text.find("gap between tags is 0.37") != std::string::npos;
  };
  const auto warned = [&] {
    const IntrinsicCalibration found = calibrate_intrinsics(folder_, board);
    return std::ranges::any_of(found.warnings, says_gap);
  };
  EXPECT_FALSE(warned());
  board.spacing = 0.35;
  EXPECT_TRUE(warned());
  for (const double wrong : {0.25, 0.5}) {
    board.spacing = wrong;
    const std::string text = complaint(board, ExitCode::kBadInput);
    EXPECT_TRUE(says_gap(text)) << text;
  }
}

TEST_F(Board, FrontalViewsDetermineNothing) {
  photograph(lens(DistortionModel::kPlumbBob), chessboard(8), 0.2, 0.5);
  const std::string text = complaint(chess(7, 7, 0.025), ExitCode::kUndetermined);
  EXPECT_NE(text.find("tilt"), std::string::npos) << text;
}

TEST_F(Board, ABoardCountedTooSmallIsRefused) {
  photograph(lens(DistortionModel::kPlumbBob), chessboard(8), 0.2, 45.0, 5);
  const std::string text = complaint(chess(6, 7, 0.025), ExitCode::kBadInput);
  EXPECT_NE(text.find("inner corners"), std::string::npos) << text;
}

TEST_F(Board, WhatMakesNoSenseIsRefused) {
  EXPECT_NE(complaint(chess(7, 7, 0.025), ExitCode::kBadInput).find("no images"),
            std::string::npos);
  for (const BoardSpec& board :
       {chess(0, 7, 0.025), chess(7, 7, 0.0), chess(7, 7, std::nan("")),
        BoardSpec{BoardType::kCharuco, 7, 7, 0.02, 0.03, 0.3, "DICT_4X4_50"},
        BoardSpec{BoardType::kCharuco, 7, 7, 0.04, 0.03, 0.3, ""},
        BoardSpec{BoardType::kCharuco, 7, 7, 0.04, 0.03, 0.3, "DICT_9X9"},
        BoardSpec{BoardType::kAprilGrid, 6, 6, 0.04, 0.0, -1.0, ""}}) {
    complaint(board, ExitCode::kBadRequest);
  }
  EXPECT_THROW((void)calibrate_intrinsics(folder_ / "absent", chess(7, 7, 0.025)), Error);
  photograph(lens(DistortionModel::kPlumbBob), charuco(6, 1), 0.24, 45.0, 3);
  EXPECT_NE(complaint(chess(9, 6, 0.025), ExitCode::kBadInput).find("none of the 3"),
            std::string::npos);
}

// Real photographs, against the values noted when they were first looked at.
struct Known {
  const char* folder;
  BoardSpec board;
  double fx;
  double tolerance;  // px: about 1 % where the known value is of another model or has its own error
  double rms_px;     // at most
};

TEST(BoardPhotographs, AgreeWithKnownLenses) {
  const BoardSpec lifecam{BoardType::kCharuco, 8, 8, 0.0254, 0.01905, 0.3, "DICT_4X4_1000"};
  BoardSpec lifecam_old = lifecam;
  lifecam_old.legacy_charuco = true;
  const std::vector<Known> cases = {
      {"vision/charuco_lifecam/new_640x480", lifecam, 679.8, 4.0, 0.3},
      {"vision/charuco_lifecam/new_1280x720", lifecam, 1128.3, 6.0, 0.35},
      {"vision/charuco_lifecam/old_640x480", lifecam_old, 687.5, 4.0, 0.4},
      {"vision/apriltag_room_mapping/calibration", chess(7, 5, 0.03), 767.5, 3.0, 0.4},
      {"vision/chessboard_webcams/lifecam_640x480", chess(10, 10, 0.0254), 704.7, 6.0, 0.4},
      {"vision/abb_charuco_wrist/images",
       {BoardType::kCharuco, 5, 7, 0.036195, 0.018256, 0.3, "DICT_6X6_250"},
       1361.8,
       20.0,
       0.6},
      {"vision/kuka_linear_chessboard/images", chess(28, 17, 0.02), 2058.4, 2.0, 0.15},
  };
  for (const Known& known : cases) {
    const auto path = shared_data(known.folder);
    if (!path) GTEST_SKIP() << "no " << known.folder << " on this machine";
    const IntrinsicCalibration found = calibrate_intrinsics(*path, known.board);
    EXPECT_NEAR(found.camera.fx, known.fx, known.tolerance) << known.folder;
    EXPECT_LT(found.rms_px, known.rms_px) << known.folder;
    EXPECT_LT(found.held_out_rms_px, 1.25 * found.rms_px) << known.folder;
  }
}

TEST(BoardPhotographs, TheWrongCharucoLayoutIsNamed) {
  const auto path = shared_data("vision/charuco_lifecam/old_640x480");
  if (!path) GTEST_SKIP() << "no ChArUco photographs on this machine";
  try {
    (void)calibrate_intrinsics(*path,
                               {BoardType::kCharuco, 8, 8, 0.0254, 0.01905, 0.3, "DICT_4X4_1000"});
    FAIL() << "took the wrong layout";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    EXPECT_NE(std::string(error.what()).find("legacy"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace kinescope
