// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/board_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/camera/marker_set.h"
#include "calib/vision/board_markers.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

cv::Mat as_mat(const ImageView& image) {  // OpenCV's detectors only read
  return {image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.data),
          static_cast<std::size_t>(image.stride)};
}

cv::TermCriteria subpixel_criteria() {
  return {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 60, 1e-4};
}

class ChessboardFinder final : public BoardFinder {
 public:
  explicit ChessboardFinder(const BoardSpec& board) : board_(board) {}

  BoardSight find(const ImageView& image) override {
    const cv::Size size(board_.columns, board_.rows);
    const cv::Mat picture = as_mat(image);
    std::vector<cv::Point2f> corners;
    bool found = cv::findChessboardCorners(
        picture, size, corners, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE);
    if (found) {
      const int window = std::clamp(static_cast<int>(0.3 * spacing(corners)), 2, 11);
      cv::cornerSubPix(picture, corners, {window, window}, {-1, -1}, subpixel_criteria());
    } else {
      found = cv::findChessboardCornersSB(picture, size, corners,
                                          cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY);
    }
    BoardSight sight;
    if (!found) return sight;
    // One search in vain is slow; more are made only where there is something.
    const bool suspected = searched_larger_ == 0 || larger_[0] + larger_[1] > 0;
    if (suspected && searched_larger_ < kSearchLarger) look_for_larger(picture);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      sight.pixels.emplace_back(static_cast<double>(corners[i].x),
                                static_cast<double>(corners[i].y));
      const int column = static_cast<int>(i) % board_.columns;
      const int row = static_cast<int>(i) / board_.columns;
      sight.places_m.emplace_back(column * board_.square_m, row * board_.square_m, 0.0);
    }
    return sight;
  }

  // Part of a larger board passes for the declared one; the views then show different parts of it.
  std::vector<std::string> settle(std::vector<BoardSight>&,
                                  const std::string& source) const override {
    for (std::size_t i = 0; i < 2; ++i) {
      if (larger_[i] == 0 || 2 * larger_[i] < searched_larger_) continue;
      throw bad_input(
          source,
          fmt::format("the board has at least {} x {} inner corners, declared are {} x {}",
                      board_.columns + (i == 0 ? 1 : 0), board_.rows + (i == 1 ? 1 : 0),
                      board_.columns, board_.rows),
          "count the inner corners, one fewer than the squares");
    }
    return {};
  }

 private:
  void look_for_larger(const cv::Mat& picture) {
    ++searched_larger_;
    for (int i = 0; i < 2; ++i) {
      std::vector<cv::Point2f> corners;
      const cv::Size size(board_.columns + (i == 0 ? 1 : 0), board_.rows + (i == 1 ? 1 : 0));
      const bool found = cv::findChessboardCorners(
          picture, size, corners, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE);
      if (found) ++larger_[static_cast<std::size_t>(i)];
    }
  }

  // The shortest step between neighbours, px.
  double spacing(const std::vector<cv::Point2f>& corners) const {
    double least = std::numeric_limits<double>::infinity();
    for (int r = 0; r < board_.rows; ++r) {
      for (int c = 0; c < board_.columns; ++c) {
        const auto at = [&](int column, int row) {
          return corners[static_cast<std::size_t>(row * board_.columns + column)];
        };
        if (c > 0) least = std::min(least, cv::norm(at(c, r) - at(c - 1, r)));
        if (r > 0) least = std::min(least, cv::norm(at(c, r) - at(c, r - 1)));
      }
    }
    return least;
  }

  static constexpr int kSearchLarger = 3;  // views
  BoardSpec board_;
  int searched_larger_ = 0;
  std::array<int, 2> larger_{};  // views with one column, one row more
};

class CharucoFinder final : public BoardFinder {
 public:
  explicit CharucoFinder(const BoardSpec& board)
      : board_(board),
        layout_(tag_layout(board.dictionary)),
        detector_(make_tag_detector(board.dictionary)) {}

  BoardSight find(const ImageView& image) override {
    BoardSight sight;
    sight.markers = find_board_markers(*detector_, layout_, image);
    std::erase_if(sight.markers, [&](const BoardMarker& marker) {
      return !charuco_marker_places(board_, board_.legacy_charuco, marker.id);
    });
    const cv::Mat picture = as_mat(image);
    for (int r = 1; r < board_.rows; ++r) {
      for (int c = 1; c < board_.columns; ++c) add_corner(picture, c, r, sight);
    }
    return sight;
  }

  std::vector<std::string> settle(std::vector<BoardSight>& sights,
                                  const std::string& source) const override {
    const double declared = misfit(sights, board_.legacy_charuco);
    if (declared <= kMaxMisfit) return {};
    const double other = misfit(sights, !board_.legacy_charuco);
    const double px = square_px(sights);
    const std::string what =
        fmt::format("the markers miss the declared board by {:.1f} px (squares are {:.0f} px)",
                    declared * px, px);
    if (other <= kMaxMisfit) {
      throw bad_input(
          source, what,
          board_.legacy_charuco
              ? fmt::format("the layout of OpenCV 4.6 and later fits to {:.1f} px: leave "
                            "out the option for the legacy layout",
                            other * px)
              : fmt::format("the layout before OpenCV 4.6 fits to {:.1f} px: declare the "
                            "legacy layout",
                            other * px));
    }
    throw bad_input(source, what, "check columns, rows, square and marker size and the dictionary");
  }

 private:
  // Predicts an inner corner from its two markers, then looks for it in the image.
  void add_corner(const cv::Mat& picture, int column, int row, BoardSight& sight) const {
    const Eigen::Vector3d place(column * board_.square_m, row * board_.square_m, 0.0);
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double square_px = 0.0;
    int count = 0;
    for (const BoardMarker& marker : sight.markers) {
      const auto places = charuco_marker_places(board_, board_.legacy_charuco, marker.id);
      const Eigen::Vector3d middle = 0.5 * ((*places)[0] + (*places)[2]);
      if ((middle - place).cwiseAbs().maxCoeff() > 0.6 * board_.square_m) continue;
      std::vector<cv::Point2f> from;
      std::vector<cv::Point2f> to;
      for (std::size_t i = 0; i < 4; ++i) {
        from.emplace_back(static_cast<float>((*places)[i].x()),
                          static_cast<float>((*places)[i].y()));
        to.emplace_back(static_cast<float>(marker.pixels[i].x()),
                        static_cast<float>(marker.pixels[i].y()));
      }
      const cv::Matx33d H = cv::getPerspectiveTransform(from, to);
      const cv::Vec3d p = H * cv::Vec3d(place.x(), place.y(), 1.0);
      sum += Eigen::Vector2d(p[0] / p[2], p[1] / p[2]);
      square_px += mean_edge(marker) * board_.square_m / board_.marker_m;
      ++count;
    }
    if (count < 2) return;
    const Eigen::Vector2d guess = sum / count;
    square_px /= count;
    const double gap = 0.5 * (1.0 - board_.marker_m / board_.square_m) * square_px;
    const int window = std::clamp(static_cast<int>(0.8 * gap), 2, 8);
    if (guess.x() < window + 1 || guess.y() < window + 1 || guess.x() > picture.cols - window - 2 ||
        guess.y() > picture.rows - window - 2) {
      return;
    }
    std::vector<cv::Point2f> corner = {
        {static_cast<float>(guess.x()), static_cast<float>(guess.y())}};
    cv::cornerSubPix(picture, corner, {window, window}, {-1, -1}, subpixel_criteria());
    const Eigen::Vector2d found(static_cast<double>(corner[0].x), static_cast<double>(corner[0].y));
    if ((found - guess).norm() > std::max(2.0, gap)) return;
    sight.pixels.push_back(found);
    sight.places_m.push_back(place);
  }

  static double mean_edge(const BoardMarker& marker) {
    double sum = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      sum += 0.25 * (marker.pixels[i] - marker.pixels[(i + 1) % 4]).norm();
    }
    return sum;
  }

  double square_px(const std::vector<BoardSight>& sights) const {
    double sum = 0.0;
    int count = 0;
    for (const BoardSight& sight : sights) {
      for (const BoardMarker& marker : sight.markers) {
        sum += mean_edge(marker) * board_.square_m / board_.marker_m;
        ++count;
      }
    }
    return count > 0 ? sum / count : 0.0;
  }

  // RMS misfit of the marker corners, as a share of a square, median over the views.
  double misfit(const std::vector<BoardSight>& sights, bool legacy) const {
    std::vector<double> shares;
    for (const BoardSight& sight : sights) {
      std::vector<Eigen::Vector3d> places;
      std::vector<Eigen::Vector2d> pixels;
      for (const BoardMarker& marker : sight.markers) {
        const auto corners = charuco_marker_places(board_, legacy, marker.id);
        if (!corners) continue;
        places.insert(places.end(), corners->begin(), corners->end());
        pixels.insert(pixels.end(), marker.pixels.begin(), marker.pixels.end());
      }
      if (places.size() < 16) continue;
      shares.push_back(plane_misfit_px(places, pixels) / square_px({sight}));
    }
    if (shares.empty()) return 0.0;
    std::ranges::sort(shares);
    return shares[shares.size() / 2];
  }

  BoardSpec board_;
  TagLayout layout_;
  std::unique_ptr<TagDetector> detector_;
};

// Kalibr's boards have two black cells around the code, other makers' one; how the tags are
// numbered and turned on the board also differs. What fits is taken; nothing fits: refused.
void check_board(const BoardSpec& board) {
  const auto refuse = [](std::string_view key, std::string_view what, std::string_view remedy) {
    throw bad_request(key, what, remedy);
  };
  const int least = board.type == BoardType::kAprilGrid ? 1 : 3;
  if (board.columns < least || board.rows < least || board.columns > 200 || board.rows > 200) {
    refuse("board size", fmt::format("{} x {} is no board", board.columns, board.rows),
           "chessboard: inner corners; ChArUco: squares; AprilGrid: tags, across and down");
  }
  if (!(board.square_m > 0.0) || !std::isfinite(board.square_m)) {
    refuse("square size", fmt::format("{} m is no size", board.square_m),
           "measure it on the print");
  }
  if (board.type == BoardType::kCharuco) {
    if (!(board.marker_m > 0.0) || !(board.marker_m < board.square_m)) {
      refuse("marker size",
             fmt::format("{} m does not fit into a square of {} m", board.marker_m, board.square_m),
             "measure the marker's black edge");
    }
    if (board.dictionary.empty()) {
      refuse("dictionary", "is missing", "name the board's dictionary, such as DICT_4X4_50");
    }
  }
  if (board.type == BoardType::kAprilGrid && !(board.spacing > 0.0)) {
    refuse("spacing", fmt::format("{} is no gap", board.spacing),
           "gap between tags divided by the tag's edge, 0.3 on Kalibr's boards");
  }
}

}  // namespace

std::vector<BoardMarker> find_board_markers(TagDetector& detector, const TagLayout& layout,
                                            const ImageView& image) {
  std::vector<BoardMarker> out;
  for (const TagObservation& tag : detector.detect(image)) {
    Corners start;
    std::ranges::copy(tag.corners_px, start.begin());
    const RefinedCorners refined = refine_corners(image, start, layout);
    out.push_back({tag.id.value,
                   {refined.corners_px.begin(), refined.corners_px.end()},
                   refined.status == RefineStatus::kDone});
  }
  // An id that is there twice says nothing.
  std::vector<BoardMarker> unique;
  for (const BoardMarker& marker : out) {
    if (std::ranges::count(out, marker.id, &BoardMarker::id) == 1) unique.push_back(marker);
  }
  return unique;
}

std::unique_ptr<BoardFinder> make_board_finder(const BoardSpec& board) {
  check_board(board);
  switch (board.type) {
    case BoardType::kChessboard:
      return std::make_unique<ChessboardFinder>(board);
    case BoardType::kCharuco:
      return std::make_unique<CharucoFinder>(board);
    case BoardType::kAprilGrid:
      return make_april_grid_finder(board);
  }
  throw bad_request("board", "of unknown type", "chessboard, charuco or aprilgrid");
}

std::optional<std::vector<Eigen::Vector3d>> charuco_marker_places(const BoardSpec& board,
                                                                  bool legacy, int id) {
  // Markers sit in the white squares, numbered row by row from the top left. Since OpenCV 4.6 the
  // top left square is black; before, the bottom left one was, which differs where the number of
  // rows is even.
  const int first =
      legacy && board.rows % 2 == 0 ? 0 : 1;  // parity of column + row of the white squares
  int next = 0;
  for (int r = 0; r < board.rows; ++r) {
    for (int c = 0; c < board.columns; ++c) {
      if ((c + r) % 2 != first) continue;
      if (next++ != id) continue;
      const Eigen::Vector3d middle((c + 0.5) * board.square_m, (r + 0.5) * board.square_m, 0.0);
      std::vector<Eigen::Vector3d> out = square_corners(board.marker_m);
      for (Eigen::Vector3d& corner : out) corner += middle;
      return out;
    }
  }
  return std::nullopt;
}

double plane_misfit_px(const std::vector<Eigen::Vector3d>& places_m,
                       const std::vector<Eigen::Vector2d>& pixels) {
  if (places_m.size() < 5) return 0.0;
  std::vector<cv::Point2d> from;
  std::vector<cv::Point2d> to;
  for (std::size_t i = 0; i < places_m.size(); ++i) {
    from.emplace_back(places_m[i].x(), places_m[i].y());
    to.emplace_back(pixels[i].x(), pixels[i].y());
  }
  const cv::Mat H = cv::findHomography(from, to, 0);
  if (H.empty()) return std::numeric_limits<double>::infinity();
  std::vector<cv::Point2d> mapped;
  cv::perspectiveTransform(from, mapped, H);
  double sum = 0.0;
  for (std::size_t i = 0; i < to.size(); ++i) sum += std::pow(cv::norm(mapped[i] - to[i]), 2);
  return std::sqrt(sum / static_cast<double>(to.size()));
}

}  // namespace kinescope
