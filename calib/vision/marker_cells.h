// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grey image and the homography that puts a marker's square into it.
// Gives   the grey levels of the marker's cells.
// Frames  the square [-1, 1]^2 of marker_edges.h (x right, y down the rows of cells), px.
#pragma once

#include <Eigen/Core>

#include "calib/vision/image_view.h"

namespace kinescope {

/// Offset from a cell's middle, as a share of its width, within which its grey is its own.
inline constexpr double kMiddleOfCell = 0.2;

/// Grey level between pixels; beyond the image's rim what is at the rim.
[[nodiscard]] double grey_at(const ImageView& image, const Eigen::Vector2d& px);

struct MarkerCells {
  Eigen::MatrixXd level;  ///< cells x cells: column of the square's x, row of its y, as (x, y)
  double contrast = 0.0;  ///< brightest minus darkest cell, grey levels

  [[nodiscard]] bool is_readable() const;
};

/// The mean around the middle of each of `cells` x `cells` cells; H maps the square to px.
[[nodiscard]] MarkerCells read_cells(const ImageView& image, const Eigen::Matrix3d& H, int cells);

/// Do both show the same code? Cells that are neither clearly dark nor clearly bright say nothing;
/// too many of them are a no.
[[nodiscard]] bool is_same_code(const MarkerCells& a, const MarkerCells& b);

}  // namespace kinescope
