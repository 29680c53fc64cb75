// SPDX-License-Identifier: Apache-2.0
//
// Kalibr's AprilGrid: markers in rows from the bottom left corner, with either border.
#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "calib/camera/marker_set.h"
#include "calib/vision/board_markers.h"
#include "kinematics/core/error.h"

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

  void settle(std::vector<BoardSight>& sights, const std::string& source) const override {
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
