// SPDX-License-Identifier: Apache-2.0
//
// Takes   a grey image, a marker's corners and how its cells lie.
// Gives   how far the steps between the cells of its code lie from where the corners put them.
// Units   px.
// Method  steps between neighbouring cells that differ, each placed by the grey between the two
//         cells' middles; a bilinear warp of the square fitted to them. What covers a marker's rim
//         (another marker's plate, a cable) makes it look narrower, as a tilt would: only its code
//         can tell the two apart.
#pragma once

#include <optional>

#include "calib/vision/refine_corners.h"

namespace kinescope {

/// The largest shift of an end of an edge, outward or inward, beyond what all ends have in common
/// (bright cells that bloom). Nothing where the code has too few steps or too little contrast.
[[nodiscard]] std::optional<double> pattern_shift(const ImageView& image, const Corners& corners,
                                                  const TagLayout& layout);

/// How far bright cells reach over dark ones, and by how much the code is larger than the corners
/// let expect, at its rim. A camera's tone curve moves the outer border inward by as much as the
/// edges inside, so that both are alike, positive, and nought in light.
struct PatternBloom {
  double bloom_px = 0.0;
  double growth_px = 0.0;
};

/// In light by `tone`, with corners and blur that were refined so. Nothing where the code has too
/// few steps or too little contrast.
[[nodiscard]] std::optional<PatternBloom> pattern_bloom(const ImageView& image,
                                                        const Corners& corners,
                                                        const TagLayout& layout,
                                                        const ToneCurve& tone, double blur_px);

/// Is the code further from the border than pixels, noise and lens allow? Where no border could be
/// fitted, from the corners that the fit began with, known to `start_sigma_px`. Not where the
/// marker is too small or too blurred to say.
[[nodiscard]] bool is_partly_hidden(const ImageView& image, const RefinedCorners& border,
                                    const TagLayout& layout, double start_sigma_px);

}  // namespace kinescope
