// SPDX-License-Identifier: Apache-2.0
//
// Frames as the unit of parallel work: one thread reads, others work, results stand in the order of
// the frames.
#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "calib/camera/tag_observations.h"
#include "calib/vision/video.h"
#include "kinematics/core/progress.h"

namespace kinescope {

/// Called on a worker thread; `worker` counts from 0.
using FrameWork =
    std::function<std::vector<TagObservation>(std::size_t worker, const VideoFrame& frame)>;

/// Reads to the end; results[i] is what `work` gave for frame i. Returns the frames' times. The
/// first exception of a worker is thrown again here.
std::vector<double> for_each_frame(VideoReader& reader, std::size_t workers, const FrameWork& work,
                                   std::vector<std::vector<TagObservation>>& results,
                                   const Progress& progress, std::string_view stage);

}  // namespace kinescope
