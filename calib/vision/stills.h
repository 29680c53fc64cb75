// SPDX-License-Identifier: Apache-2.0
//
// Takes   a video and the times of some of its frames.
// Gives   those frames as small pictures for a page.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace kinescope {

struct Still {
  double time_s = 0.0;
  int width = 0;  ///< of the video; the picture itself may be smaller
  int height = 0;
  std::string jpeg_base64;
};

/// The frames of those times, in their order; what does not decode is left out. `times_s`:
/// increasing. `width`: px that a picture has at most. Throws as open_video does.
[[nodiscard]] std::vector<Still> stills_at(const std::filesystem::path& video,
                                           const std::vector<double>& times_s, int width);

}  // namespace kinescope
