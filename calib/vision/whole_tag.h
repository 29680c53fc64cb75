// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grey image and a marker whose outer border has been fitted (refine_corners.h).
// Gives   its corners from the steps between all its cells.
// Units   px, grey levels; the square [-1, 1]^2 of marker_edges.h.
// Method  pixel = dark + (bright - dark) T(S): S the share of bright cells under the blur
//         (tag_light.h), T the camera's tone curve. Gauss-Newton for the homography, the blur, the
//         tone curve's gamma, a spread of bright over dark, and the levels. Steps inside go both
//         ways, the border's all one way: what moves edges shows apart from the marker's size.
//         Covariance from the pulls of 8 px blocks (compression). The declared lens is undone
//         first: of what bends a marker beyond a homography the part that scales it cannot be told
//         from its size, so an unknown lens cannot be fitted here.
#pragma once

#include "calib/vision/refine_corners.h"

namespace kinescope {

/// `border` with better corners and sigma; as it is where the marker does not look like the model
/// (partly hidden, a shadow across it, cells too small for the blur). `tone` linear: not known.
[[nodiscard]] RefinedCorners refine_by_cells(const ImageView& image, const RefinedCorners& border,
                                             const TagLayout& layout, const ToneCurve& tone,
                                             const CameraModel& lens);

}  // namespace kinescope
