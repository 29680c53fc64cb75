// SPDX-License-Identifier: Apache-2.0
//
// Takes   markers of one recording, each in its image.
// Gives   the camera's tone curve, where it moves their edges.
// Method  blur is even in light; a camera that brightens half tones makes bright areas grow over
//         dark ones by a share of the blur (0.35 at gamma 2.2). The outer border moves inward, the
//         cells inside by the sign of their step (pattern_shift.h): the curve is the one in whose
//         light they do not. Ink that spread in print does the same by a length on the marker. The
//         border's profile tells the curve too, but compression bends it more.
// Not here: what overexposure does; it is told from a tone curve and left as it is.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "calib/camera/marker_set.h"
#include "calib/vision/image_view.h"
#include "calib/vision/refine_corners.h"
#include "calib/vision/tone_curve.h"

namespace kinescope {

/// One sighting of a marker.
struct ToneView {
  ImageView image;
  TagId id;
  Corners corners_px;   ///< as refined without a tone curve
  double size_m = 0.0;  ///< edge of the marker; 0 where unknown
};

struct FoundTone {
  ToneCurve curve;              ///< linear where no tone curve explains the shift
  double shift_px = 0.0;        ///< by which it moves edges, median of the views
  double sigma_per_blur = 0.0;  ///< of what is left of the shift, px per px of blur
  [[nodiscard]] bool is_explained() const { return !curve.is_linear(); }
};

/// Fewer views tell nothing.
inline constexpr std::size_t kFewestToneViews = 6;

/// Is the marker large enough in the image to be a view?
[[nodiscard]] bool shows_tone(const Corners& corners_px, const TagLayout& layout);

/// Nothing where edges are where they should be, as far as the markers tell.
[[nodiscard]] std::optional<FoundTone> find_tone(std::span<const ToneView> views,
                                                 const TagLayout& layout);

}  // namespace kinescope
