// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/follow_tag.h"

#include "calib/vision/marker_cells.h"
#include "calib/vision/marker_edges.h"

namespace kinescope {

std::optional<RefinedCorners> follow_tag(const ImageView& image, const Corners& expected,
                                         const LastSighting& last, const TagLayout& layout,
                                         const ToneCurve& tone, const CameraModel* lens) {
  const auto before = corner_fit::tag_to_image(last.corners);
  if (!before) return std::nullopt;
  RefinedCorners refined = refine_corners(image, expected, layout, tone, lens);
  if (refined.status != RefineStatus::kDone) return std::nullopt;
  const auto now = corner_fit::tag_to_image(refined.corners_px);
  if (!now || !is_same_code(read_cells(last.image, *before, layout.cells),
                            read_cells(image, *now, layout.cells))) {
    return std::nullopt;
  }
  return refined;
}

}  // namespace kinescope
