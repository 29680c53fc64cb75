// SPDX-License-Identifier: Apache-2.0
//
// Takes   the markers found in one frame after another, and the joint values that come beside them.
// Gives   CaptureGuide: what a recording holds so far; what it still lacks, in words.
// Method  a marker's view is refused where `inspect` would complain of it (recording_advice.h), or
//         where the marker is seen edge on, or its white is at the end of the camera's scale. What
//         is refused counts for nothing here; it is recorded all the same, as `run` judges for
//         itself.
// Units   px, degrees; joint values in their own units.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/explain/recording_advice.h"
#include "calib/camera/marker_set.h"
#include "calib/camera/tag_observations.h"
#include "calib/vision/image_grid.h"
#include "calib/vision/image_view.h"

namespace kinescope {

/// Why a view of a marker, or a frame, is of no use.
enum class Refusal { kNone, kNoMarker, kSmall, kEdgeOn, kBlurred, kDark, kClipped };
/// "no marker", "marker too small", ..; empty for kNone.
[[nodiscard]] std::string_view to_string(Refusal refusal);

/// One marker in one frame.
struct MarkerView {
  TagObservation tag;
  double edge_px = 0.0;   ///< medians over its edges
  double contrast = 0.0;  ///< grey levels of 255
  double blur_px = 0.0;
  double tilt_deg = 0.0;  ///< of its plane to the image's, as the perspective is weak
  Refusal refusal = Refusal::kNone;
};

/// All of one frame; refused where no view of it is of use.
struct FrameView {
  int width = 0;
  int height = 0;
  std::vector<MarkerView> markers;
  Refusal refusal = Refusal::kNone;
};
[[nodiscard]] FrameView look_at_frame(const ImageView& image, std::span<const TagObservation> tags);

/// Tilt of a square's plane to the image's from its corners, degrees: arc cosine of the ratio of
/// the singular values of the affine map that is nearest to them.
[[nodiscard]] double tilt_of_square_deg(std::span<const Eigen::Vector2d> corners_px);

/// One marker in all frames so far.
struct MarkerTally {
  int frames = 0;  ///< in which it was seen
  int used = 0;    ///< of these, not refused
  std::vector<double> edges_px, contrasts, blurs_px;
  double most_tilt_deg = 0.0;  ///< of those used
};

struct ChannelTally {
  std::string name;
  ChannelSpan span;
};

struct CaptureGuide {
  int frames = 0;  ///< looked at
  int used = 0;
  std::map<Refusal, int> refused;  ///< frames
  std::map<TagId, MarkerTally> markers;
  GridCounts grid = empty_grid();  ///< corners of the views that are used
  int rows = 0;                    ///< of joint values
  std::vector<ChannelTally> channels;

  [[nodiscard]] double most_tilt_deg() const;
};

void add_frame(CaptureGuide& guide, const FrameView& frame);
/// `values`: one a channel of `names`, which are always the same.
void add_joint_values(CaptureGuide& guide, const std::vector<std::string>& names,
                      std::span<const double> values);

/// What is known beside the frames.
struct Declared {
  MarkerSet markers;
  bool camera = false;  ///< intrinsics are known
  bool joints = false;  ///< joint values are to come
};

/// What would make the recording better, the most important first; empty: it will do.
[[nodiscard]] std::vector<std::string> what_is_missing(const CaptureGuide& guide,
                                                       const Declared& declared);

}  // namespace kinescope
