// SPDX-License-Identifier: Apache-2.0
//
// Takes   a recording's video and what is declared about its markers.
// Gives   TagObservations: corners with their sigma in every frame; wrong ids and ghosts put aside with a
//         reason.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/camera/marker_set.h"
#include "calib/camera/tag_observations.h"
#include "calib/vision/tag_detector.h"
#include "kinematics/core/progress.h"

namespace kinescope {

struct DetectOptions {
  DetectorOptions detector;
  int threads = 2;
  int min_sightings = 5;  ///< markers seen in fewer frames are ghosts
};

struct Detection {
  TagObservations observations;
  std::vector<std::string> warnings;
};

/// Deterministic, whatever the number of threads. Throws bad_input for an unreadable video.
[[nodiscard]] Detection detect_tags(const std::filesystem::path& video, const MarkerSet& markers,
                                    const DetectOptions& options = {},
                                    const Progress& progress = {});

}  // namespace kinescope
