// SPDX-License-Identifier: Apache-2.0
//
// Takes   how markers look in a frame, and the range of a joint's channel.
// Gives   what is wrong with them and what to do about it, in words: the same before a recording is
//         made (`capture`) and after (`inspect`).
// Units   px, grey levels of 255; a channel in its own unit.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/camera/tag_observations.h"
#include "calib/vision/image_view.h"

namespace kinescope {

inline constexpr double kSmallMarkerPx = 20.0;  ///< below this a marker's pose flips and jitters
inline constexpr double kBlurredPx = 2.0;
inline constexpr double kLowContrast = 40.0;

/// The edges of one marker, of one or of several frames.
struct MarkerEdges {
  std::vector<double> edges_px;   ///< lengths
  std::vector<double> contrasts;  ///< steps of grey values across them
  std::vector<double> blurs_px;   ///< sigma of the blur that would give these steps their slope
  std::vector<double> brights;    ///< grey values beside them
};
void add_edges(MarkerEdges& out, const ImageView& image, const TagObservation& tag);

/// Of a marker's medians; empty where nothing is wrong.
[[nodiscard]] std::vector<std::string> marker_advice(TagId id, double edge_px, double blur_px,
                                                     double contrast);
/// Of a marker that tags.yaml lists.
[[nodiscard]] std::string listed_but_not_seen(TagId id, int frames);
inline constexpr const char* kOneMarkerOnly =
    "one marker only: at most one joint, between it and the camera, can be found";

/// The values of one channel.
struct ChannelSpan {
  double lower = 0.0;
  double upper = 0.0;
  bool whole = false;  ///< all are whole numbers
  [[nodiscard]] double range() const { return upper - lower; }
  [[nodiscard]] bool moves() const;
};

/// "ticks?", "deg or mm?", or "rad or m" where nothing speaks against it.
[[nodiscard]] std::string guess_unit(const ChannelSpan& span);
/// Nothing where the channel moves enough.
[[nodiscard]] std::optional<std::string> channel_advice(const std::string& name,
                                                        const std::string& unit,
                                                        const ChannelSpan& span);

}  // namespace kinescope
