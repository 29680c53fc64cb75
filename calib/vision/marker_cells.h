// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grey image and the homography that puts a marker's square into it.
// Gives   the grey levels of the marker's cells.
// Frames  the square [-1, 1]^2 of marker_edges.h (x right, y down the rows of cells), px.
#pragma once

#include <Eigen/Core>

#include "calib/vision/image_view.h"
#include "calib/vision/tone_curve.h"

namespace kinescope {

/// Offset from a cell's middle, as a share of its width, within which its grey is its own.
inline constexpr double kMiddleOfCell = 0.2;
/// Of the contrast, away from half way: dark or bright.
inline constexpr double kClearCell = 0.15;

/// Light, by `tone`, between pixels: grey level where that is linear. Beyond the image's rim what
/// is at the rim.
[[nodiscard]] double light_at(const ImageView& image, const Eigen::Vector2d& px,
                              const ToneCurve& tone);

struct MarkerCells {
  Eigen::MatrixXd level;  ///< cells x cells: column of the square's x, row of its y, as (x, y)
  double contrast = 0.0;  ///< brightest minus darkest cell

  [[nodiscard]] bool is_readable() const;
};

/// The mean around the middle of each of `cells` x `cells` cells, in light by `tone` and as far as
/// `middle` (share of a cell); H maps the square to px.
[[nodiscard]] MarkerCells read_cells(const ImageView& image, const Eigen::Matrix3d& H, int cells,
                                     const ToneCurve& tone = ToneCurve(),
                                     double middle = kMiddleOfCell);

/// Do both show the same code? Cells that are neither clearly dark nor clearly bright say nothing;
/// too many of them are a no.
[[nodiscard]] bool is_same_code(const MarkerCells& a, const MarkerCells& b);

}  // namespace kinescope
