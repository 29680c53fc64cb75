// SPDX-License-Identifier: Apache-2.0
//
// Images of a bag as a video: raw (mono, rgb, bgr, Bayer, YUV 4:2:2, 16 bits), packed as JPEG or
// PNG, or a stream of H.264 and its like. Times are those of bags::look_into().
#pragma once

#include <memory>

#include "calib/vision/video.h"
#include "kinematics/bags/bag.h"

namespace kinescope {

/// Throws bad_input as open_video() and bags::choose_images(), and for an encoding that is not
/// read.
[[nodiscard]] std::unique_ptr<VideoReader> open_bag_video(const bags::Source& source);

}  // namespace kinescope
