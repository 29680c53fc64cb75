// SPDX-License-Identifier: Apache-2.0
//
// Small videos with chosen stamps, for tests.
#pragma once

#include <filesystem>
#include <vector>

#include "calib/vision/image_view.h"

namespace kinescope {

struct VideoSpec {
  std::vector<GreyImage> frames;
  std::vector<int> stamps_ms;  ///< of each frame
  int b_frames = 0;            ///< frames predicted from both sides, stored out of order
};

/// MPEG-4 in the container of the file's extension.
void write_video(const std::filesystem::path& path, const VideoSpec& spec);

}  // namespace kinescope
