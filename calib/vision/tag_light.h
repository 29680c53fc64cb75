// SPDX-License-Identifier: Apache-2.0
//
// Takes   a marker's code and a place on it.
// Gives   how much of the light there is that of bright cells, under a Gaussian blur of any shape.
// Units   cells from the marker's first corner of the square (left top), px in the image.
// Method  for one line of cells each way it is a bivariate normal probability, with the blur's
//         correlation between the two: the tetrachoric series (Pearson 1900, Phil. Trans. A 195)
//         Phi2(x, y; r) = Phi(x) Phi(y) + sum_k r^k / k! Phi^(k)(x) Phi^(k)(y), whose terms are
//         products of a column's and a row's part, so that any code is a sum over lines.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "calib/vision/image_view.h"
#include "calib/vision/tag_detector.h"

namespace kinescope::whole_tag {

enum class Cell : std::uint8_t { kDark = 0, kBright = 1, kUnclear = 2 };

/// The cells of a marker and those around it.
class TagCode {
 public:
  TagCode(int cells, Cell around);
  [[nodiscard]] int cells() const { return cells_; }
  /// From -1 to cells().
  [[nodiscard]] Cell at(int column, int row) const { return code_[index(column, row)]; }
  void set(int column, int row, Cell cell) { code_[index(column, row)] = cell; }

 private:
  [[nodiscard]] std::size_t index(int column, int row) const {
    return static_cast<std::size_t>((row + 1) * (cells_ + 2) + column + 1);
  }
  int cells_;
  std::vector<Cell> code_;
};

struct SeenCode {
  TagCode code;
  double dark = 0.0;  ///< grey levels, medians
  double bright = 0.0;
};

/// By the grey of the cells' middles, with the blur undone; H maps the square [-1, 1]^2 of
/// marker_edges.h to px, `blur_cells` is the blur along x and y. Nothing without contrast.
[[nodiscard]] std::optional<SeenCode> read_code(const ImageView& image, const Eigen::Matrix3d& H,
                                                const TagLayout& layout,
                                                const Eigen::Vector2d& blur_cells);

/// The lines between cells (0 .. cells, the outer border among them) that are near a place.
struct LinesNear {
  int before = 0;  ///< the cell before the first of them, or the only one
  int count = 0;
  [[nodiscard]] int line(int i) const { return before + 1 + i; }
};
[[nodiscard]] LinesNear lines_near(double place, double reach, int cells);

/// Where a pixel is on the marker.
struct TagPlace {
  double x = 0.0;            ///< columns, from the left border
  double y = 0.0;            ///< rows, from the upper border
  Eigen::Vector2d per_px_x;  ///< change of x per px right and down
  Eigen::Vector2d per_px_y;
};

/// The blur where a pixel is, along x and y in cells.
struct LocalBlur {
  double x = 0.0;
  double y = 0.0;
  double correlation = 0.0;
};
[[nodiscard]] LocalBlur local_blur(const TagPlace& place, const Eigen::Matrix2d& blur_px2);

/// The largest blur of which bright_share() knows.
inline constexpr double kMostBlur = 0.8;  // cells

/// The share of bright cells, and how it changes.
struct Share {
  double value = 0.0;
  double x = 0.0;                                  ///< per cell right
  double y = 0.0;                                  ///< per cell down
  Eigen::Vector3d blur = Eigen::Vector3d::Zero();  ///< per px^2 of the blur's xx, xy, yy
  double spread = 0.0;  ///< per px by which bright cells grow over dark ones
  double peak = 0.0;    ///< per px^4 of the blur's fourth cumulant, alike in all directions
};

/// Not for places near unclear cells. `blur_px2`: the blur's covariance in the image.
[[nodiscard]] Share bright_share(const TagCode& code, const TagPlace& place,
                                 const Eigen::Matrix2d& blur_px2);

}  // namespace kinescope::whole_tag
