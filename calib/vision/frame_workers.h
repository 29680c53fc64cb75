// SPDX-License-Identifier: Apache-2.0
//
// Runs of frames as the unit of parallel work: one thread reads, others work, results stand in the
// order of the frames.
#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "calib/camera/tag_observations.h"
#include "calib/vision/video.h"
#include "kinematics/core/progress.h"

namespace kinescope {

/// The markers in each frame, in the order of the frames.
using FrameTags = std::vector<std::vector<TagObservation>>;

/// Called on a worker thread with consecutive frames; `worker` counts from 0.
using FrameWork = std::function<FrameTags(std::size_t worker, const std::vector<VideoFrame>& run)>;

/// Reads to the end, in runs of `run_length` frames from the first one on (the last one may be
/// shorter); results[i] is what `work` gave for frame i. Returns the frames' times. The first
/// exception of a worker is thrown again here.
std::vector<double> for_each_run(VideoReader& reader, std::size_t workers, std::size_t run_length,
                                 const FrameWork& work, FrameTags& results,
                                 const Progress& progress, std::string_view stage);

}  // namespace kinescope
