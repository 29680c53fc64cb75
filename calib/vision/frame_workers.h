// SPDX-License-Identifier: Apache-2.0
//
// Runs of frames as the unit of parallel work: one thread fills them, others work on them in place.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "calib/camera/tag_observations.h"
#include "calib/vision/video.h"

namespace kinescope {

/// A frame with the markers found in it.
struct SearchedFrame {
  VideoFrame frame;
  std::vector<TagObservation> tags;
};

/// Makes the next frame of a span ready; false where there is none any more.
using FillFrame = std::function<bool(SearchedFrame& frame)>;

/// Called on a worker thread with consecutive frames; `worker` counts from 0.
using RunWork = std::function<void(std::size_t worker, std::span<SearchedFrame> run)>;

/// Fills `frames` in their order and has runs of `run_length` of them worked on (the last one may
/// be shorter) while further ones are filled. Returns how many were filled. The first exception of
/// `fill` or of a worker is thrown again here.
std::size_t for_each_run(std::span<SearchedFrame> frames, std::size_t run_length,
                         std::size_t workers, const FillFrame& fill, const RunWork& work);

}  // namespace kinescope
