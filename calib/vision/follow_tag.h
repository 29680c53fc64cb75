// SPDX-License-Identifier: Apache-2.0
//
// Takes   a marker seen in one frame, and where it should be in the next one.
// Gives   its refined corners there, without any search.
// Method  refine_corners() from the expected place; believed where the cells between the corners
//         show what they showed in the frame before. A marker that is covered, left, or moved
//         otherwise than expected is not found so, and has to be searched for.
// Units   px.
#pragma once

#include <optional>

#include "calib/vision/refine_corners.h"

namespace kinescope {

/// Where a marker was.
struct LastSighting {
  const ImageView& image;
  const Corners& corners;
};

[[nodiscard]] std::optional<RefinedCorners> follow_tag(const ImageView& image,
                                                       const Corners& expected,
                                                       const LastSighting& last,
                                                       const TagLayout& layout,
                                                       const ToneCurve& tone = ToneCurve(),
                                                       const CameraModel* lens = nullptr);

}  // namespace kinescope
