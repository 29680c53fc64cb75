// SPDX-License-Identifier: Apache-2.0
//
// Kalibr's AprilGrid: markers in rows from the bottom left corner, with either border.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "calib/camera/marker_set.h"
#include "calib/vision/board_markers.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

class AprilGridFinder final : public BoardFinder {
 public:
  explicit AprilGridFinder(const BoardSpec& board) : board_(board) {
    const std::string family = board.dictionary.empty() ? "tag36h11" : board.dictionary;
    families_ = {family};
    if (family == "tag36h11") families_.emplace_back("tag36h11b2");
    for (const std::string& name : families_) {
      detectors_.push_back(make_tag_detector(name));
      layouts_.push_back(tag_layout(name));
    }
  }

  BoardSight find(const ImageView& image) override {
    BoardSight sight;
    for (std::size_t i = 0; i < detectors_.size(); ++i) {
      std::vector<BoardMarker> markers = find_board_markers(*detectors_[i], layouts_[i], image);
      std::erase_if(markers, [&](const BoardMarker& marker) {
        return marker.id >= board_.columns * board_.rows || !marker.refined;
      });
      if (markers.size() > sight.markers.size()) sight.markers = std::move(markers);
    }
    return sight;
  }

  std::vector<std::string> settle(std::vector<BoardSight>& sights,
                                  const std::string& source) const override {
    double best = std::numeric_limits<double>::infinity();
    int best_turn = 0;
    bool best_up = true;
    for (const bool upward : {true, false}) {
      for (int turn = 0; turn < 4; ++turn) {
        const double share = misfit(sights, upward, turn);
        if (share < best) best = share, best_turn = turn, best_up = upward;
      }
    }
    if (!(best <= kMaxMisfit)) {
      throw bad_input(
          source,
          fmt::format("the tags miss the declared grid by {:.0f} % of a tag's edge", 100.0 * best),
          "check columns, rows, tag size and spacing; ids must run row by row from 0");
    }
    for (BoardSight& sight : sights) fill(sight, best_up, best_turn);
    return check_spacing(sights, best_up, best_turn, source);
  }

 private:
  // Corner `corner` (lb, rb, rt, lt of the tag as detected) of a tag, turned by quarter turns on
  // the board.
  Eigen::Vector3d place(int id, int corner, bool upward, int turn) const {
    const double pitch = board_.square_m * (1.0 + board_.spacing);
    const int row = upward ? board_.rows - 1 - id / board_.columns : id / board_.columns;
    const int k = (corner + turn) % 4;
    const double right = k == 1 || k == 2 ? 1.0 : 0.0;
    const double down = k == 0 || k == 1 ? 1.0 : 0.0;
    return {(id % board_.columns) * pitch + right * board_.square_m,
            row * pitch + down * board_.square_m, 0.0};
  }

  void fill(BoardSight& sight, bool upward, int turn) const {
    sight.pixels.clear();
    sight.places_m.clear();
    for (const BoardMarker& marker : sight.markers) {
      for (int corner = 0; corner < 4; ++corner) {
        sight.pixels.push_back(marker.pixels[static_cast<std::size_t>(corner)]);
        sight.places_m.push_back(place(marker.id, corner, upward, turn));
      }
    }
  }

  // Spacings from tag b beside or below tag a: the cross ratio of the four corners along an edge of
  // both is the same in every view, (1 + s)^2 / ((2 + s) s), and lens distortion hardly bends so
  // short a line.
  static void add_spacings(const BoardMarker& a, const BoardMarker& b, int axis, int turn,
                           std::vector<double>& spacings) {
    for (const bool far_side : {false, true}) {
      const std::size_t start = corner_at(turn, axis, false, far_side);
      const std::size_t end = corner_at(turn, axis, true, far_side);
      const double ratio =
          (b.pixels[start] - a.pixels[start]).norm() * (b.pixels[end] - a.pixels[end]).norm() /
          ((b.pixels[end] - a.pixels[start]).norm() * (b.pixels[start] - a.pixels[end]).norm());
      if (ratio > 1.0) spacings.push_back(std::sqrt(ratio / (ratio - 1.0)) - 1.0);
    }
  }

  std::vector<double> spacings_in(const BoardSight& sight, bool upward, int turn) const {
    const double pitch = board_.square_m * (1.0 + board_.spacing);
    std::vector<double> out;
    for (const BoardMarker& a : sight.markers) {
      for (const BoardMarker& b : sight.markers) {
        const Eigen::Vector3d step = place(b.id, 0, upward, turn) - place(a.id, 0, upward, turn);
        for (const int axis : {0, 1}) {
          const bool next = std::abs(step[axis] - pitch) + std::abs(step[1 - axis]) < 0.5 * pitch;
          if (next) add_spacings(a, b, axis, turn, out);
        }
      }
    }
    return out;
  }

  // Index of the corner at the start or end of an edge along `axis` (0 right, 1 down), on the near
  // or far side of the tag.
  static std::size_t corner_at(int turn, int axis, bool end, bool far_side) {
    const bool right = axis == 0 ? end : far_side;
    const bool down = axis == 0 ? far_side : end;
    const int k = down ? (right ? 1 : 0) : (right ? 2 : 3);
    return static_cast<std::size_t>((k - turn + 4) % 4);
  }

  // The fit cannot tell a wrong spacing from a poor lens: the tags' own pictures can.
  std::vector<std::string> check_spacing(const std::vector<BoardSight>& sights, bool upward,
                                         int turn, const std::string& source) const {
    std::vector<double> spacings;
    std::vector<double> edges_px;
    for (const BoardSight& sight : sights) {
      std::ranges::copy(spacings_in(sight, upward, turn), std::back_inserter(spacings));
      for (const BoardMarker& tag : sight.markers) {
        edges_px.push_back((tag.pixels[0] - tag.pixels[1]).norm());
      }
    }
    if (spacings.empty()) return {};
    const double measured = median_of(spacings);
    const double off = std::abs(measured - board_.spacing);
    for (double& spacing : spacings) spacing = std::abs(spacing - measured);
    constexpr double kSigmas = 3.0;  // of one pair of tags, many though there are
    if (off <= kSigmas * kSigmaOverMedian * median_of(spacings)) return {};
    // The distance takes up the pitch; tags are then too large or small by off / (1 + s), and
    // their corners lie half a diagonal from the middle.
    const double edge_px = median_of(edges_px);
    const double misfit_px = off / (1.0 + measured) * edge_px / std::numbers::sqrt2;
    const std::string what = fmt::format(
        "by the images the gap between tags is {:.3f} of a tag's edge, declared is {:.3f}",
        measured, board_.spacing);
    const std::string remedy = "measure the tag's black edge and the gap on the print";
    if (misfit_px > max_size_misfit_px(edge_px)) {
      throw bad_input(source,
                      fmt::format("{}: corners miss the board by {:.1f} px", what, misfit_px),
                      remedy + "; the spacing is their ratio");
    }
    return {what + ": " + remedy};
  }

  double misfit(const std::vector<BoardSight>& sights, bool upward, int turn) const {
    std::vector<double> shares;
    for (BoardSight sight : sights) {
      if (sight.markers.size() < 3) continue;
      fill(sight, upward, turn);
      const double edge = (sight.pixels[0] - sight.pixels[1]).norm();
      shares.push_back(plane_misfit_px(sight.places_m, sight.pixels) / edge);
    }
    if (shares.empty()) return 0.0;
    std::ranges::sort(shares);
    return shares[shares.size() / 2];
  }

  BoardSpec board_;
  std::vector<std::string> families_;
  std::vector<std::unique_ptr<TagDetector>> detectors_;
  std::vector<TagLayout> layouts_;
};

}  // namespace

std::unique_ptr<BoardFinder> make_april_grid_finder(const BoardSpec& board) {
  return std::make_unique<AprilGridFinder>(board);
}

}  // namespace kinescope
