// SPDX-License-Identifier: Apache-2.0
//
// Takes   a recording's video and what is declared about its markers.
// Gives   TagObservations: corners with their sigma in every frame; wrong ids and ghosts put aside
// with a
//         reason.
// Method  whole frames at full resolution now and then, so that markers that enter are noticed;
//         between them markers are followed by their edges alone (follow_tag.h), else in windows,
//         and the whole frame is searched at reduced resolution where one of them is lost. Markers
//         lost on the way are looked for again where their neighbours in time say they are;
//         refine_corners() gives corners and sigma, pattern_shift.h finds what is covered,
//         find_tone.h the camera's tone curve, sightings.h decides what is believed. Pictures
//         taken one by one are searched whole.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/camera/marker_set.h"
#include "calib/camera/tag_observations.h"
#include "calib/vision/tag_detector.h"
#include "kinematics/core/progress.h"

namespace kinescope {

struct DetectOptions {
  DetectorOptions detector{.decimate = 2.0};  ///< of the search over whole frames
  int threads = 2;
  int min_sightings =
      5;  ///< markers seen in fewer frames (or a tenth of a short recording) are ghosts
  int full_search_every =
      30;                 ///< every so many frames the whole of one is searched at full resolution
  bool fill_gaps = true;  ///< look again, at full resolution, where a marker should be
  bool refine_corners = true;  ///< false keeps the detector's corners
  /// As declared. Without it corners come from the markers' borders alone (refine_corners.h).
  std::optional<CameraModel> lens = std::nullopt;
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
