// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grey image and a tag's corners to about a pixel.
// Gives   the corners to a few hundredths of a pixel, with their standard deviation.
// Method  the tag's outer border as four blurred steps, fitted together to the raw pixels beside
// it: a weakly
//         curved line an edge, a blur a pair of opposite edges, grey levels inside and outside that
//         change along the edge (shadows cross markers). Pixels near the corners and a blur's reach
//         from the neighbouring cells are left out, so that the pattern does not pull on the
//         border. Corners are where neighbouring lines meet. Cramer-Rao for a line of length L:
//         sigma = 2 / sqrt(I L), I = A^2 / (2 sqrt(pi) b s^2) (A contrast, b blur, s pixel noise).
#pragma once

#include <array>

#include <Eigen/Core>

#include "calib/camera/camera_model.h"
#include "calib/vision/image_view.h"
#include "calib/vision/tag_detector.h"
#include "calib/vision/tone_curve.h"

namespace kinescope {

using Corners = std::array<Eigen::Vector2d, 4>;  ///< lb, rb, rt, lt, px

/// Where, and why not, a fit ended.
enum class RefineStatus {
  kNotRun,
  kDone,
  kTooFewPixels,   ///< too small, or cut by the image's border
  kWrongContrast,  ///< no step, or the wrong way round
  kBadFit,         ///< the pixels do not look like a blurred step
  kMoved,          ///< ended too far from where it began
  kNotConverged
};

struct RefinedCorners {
  RefineStatus status = RefineStatus::kNotRun;
  Corners corners_px;  ///< the start where the status is not kDone
  double sigma_px =
      0.0;  ///< of one coordinate, RMS over the corners, with the floor; only for kDone
  double contrast = 0.0;  ///< outside minus inside, grey levels
  double noise = 0.0;     ///< standard deviation of what the model leaves, grey levels
  double blur_px = 0.0;   ///< standard deviation of the step's blur, larger of the two directions
  bool by_cells = false;  ///< by the steps between all cells (whole_tag.h), else the border's alone
};

/// `tone`: how the camera turns light to grey. A blurred step is even in light only; without its
/// curve, bright areas grow over dark ones.
/// By the steps between all cells (whole_tag.h) where the `lens` is declared, else by the border
/// alone: cells in a picture that an unknown lens bends say a wrong size.
[[nodiscard]] RefinedCorners refine_corners(const ImageView& image, const Corners& start,
                                            const TagLayout& layout,
                                            const ToneCurve& tone = ToneCurve(),
                                            const CameraModel* lens = nullptr);

/// By the outer border alone.
[[nodiscard]] RefinedCorners refine_border(const ImageView& image, const Corners& start,
                                           const TagLayout& layout,
                                           const ToneCurve& tone = ToneCurve());

}  // namespace kinescope
