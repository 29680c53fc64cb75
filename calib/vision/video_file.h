// SPDX-License-Identifier: Apache-2.0
//
// Video files through FFmpeg's libraries. OpenCV's reader is not used: it computes times from an
// average frame rate where the container has the true stamps, and it hides damage.
#pragma once

#include <filesystem>
#include <memory>

#include "calib/vision/video.h"

namespace kinescope {

/// Throws bad_input as open_video(). The first frame is the file's, or with `from_s` the last key
/// frame up to that stamp, s.
[[nodiscard]] std::unique_ptr<VideoReader> open_video_file(const std::filesystem::path& path,
                                                           double from_s = 0.0);

}  // namespace kinescope
