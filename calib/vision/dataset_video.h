// SPDX-License-Identifier: Apache-2.0
//
// The videos of a LeRobot dataset's camera: of the chosen episodes, one after the other, each cut
// out of its file (version 3.0 keeps several in one) by its stamps. Times are those of
// datasets::choose_episodes(), the clock of the joint log.
#pragma once

#include <memory>

#include "calib/vision/video.h"
#include "kinematics/datasets/dataset.h"

namespace kinescope {

/// Throws bad_input as datasets::choose_camera(), and naming the file: a video that is not there,
/// or whose first frame cannot be decoded.
[[nodiscard]] std::unique_ptr<VideoReader> open_dataset_video(const datasets::Source& source);

}  // namespace kinescope
