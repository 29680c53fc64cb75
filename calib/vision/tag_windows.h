// SPDX-License-Identifier: Apache-2.0
//
// Takes   an image and where markers should be in it.
// Gives   those that are there: only a part of the image is searched.
// Units   px.
#pragma once

#include <optional>
#include <vector>

#include "calib/vision/tag_detector.h"

namespace kinescope {

/// Where a marker is looked for; borders inclusive.
struct TagWindow {
  TagId id;
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  double edge = 0.0;  ///< of the marker that is expected
};

/// Around corners, `reach` px further, plus the margin that a detector needs; nothing where less
/// than a marker's worth of it lies in the image.
[[nodiscard]] std::optional<TagWindow> window_around(TagId id,
                                                     const std::vector<Eigen::Vector2d>& corners_px,
                                                     double reach, int width, int height);

/// Where a marker should be in the next frame.
struct TagPrediction {
  std::vector<Eigen::Vector2d> corners_px;
  double reach = 0.0;         ///< px around them, for what its motion may change by
  bool motion_known = false;  ///< it was also seen in the frame before
};

/// From its sighting in a frame and, for its motion, those of the frame before that.
[[nodiscard]] TagPrediction predict_tag(const TagObservation& last,
                                        const std::vector<TagObservation>& before_last);

/// How bright the pixels are taken to be. A glint beside a marker hides it from a detector that
/// thresholds by the brightest pixel nearby.
enum class Brightness {
  kAsSeen,
  kCutOff,  ///< at one grey level after the other, until the marker is seen
};

/// In each window the marker that it was made for.
[[nodiscard]] std::vector<TagObservation> search_windows(TagDetector& detector,
                                                         const ImageView& image,
                                                         const std::vector<TagWindow>& windows,
                                                         Brightness brightness);

}  // namespace kinescope
