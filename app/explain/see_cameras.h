// SPDX-License-Identifier: Apache-2.0
//
// Takes   a recording of several fixed cameras.
// Gives   what all of them saw, on one clock and in one camera's frame: a frame is one camera's
//         picture at its time, and everything behind goes on as with one camera.
// Method  Every camera is looked at alone; calib/tracks/several_cameras.h places them. Where only
//         resting markers are common, each camera's own motion against the joint log ties the
//         clocks.
#pragma once

#include <functional>
#include <optional>

#include "app/explain/pipeline.h"
#include "calib/tracks/several_cameras.h"

namespace kinescope {

/// One camera's view.
struct SeenAlone {
  Observed observed;
  CameraModel camera;
};

struct SeenTogether {
  Observed observed;
  CameraModel camera;   ///< of the reference camera
  PoseTracks tracks;    ///< in its frame, by the common frames
  Recording recording;  ///< with the reference camera's declarations, gravity in its frame
  /// Of several recordings: what was detected in each, as they were given.
  std::vector<TagObservations> detected = {};
};

/// One camera (or tracker), before the others are known.
struct LoneCamera {
  Recording recording;  ///< of it alone, with its name
  SeenAlone seen;
  PoseTracks tracks;  ///< by its own frames and clock, in its frame; empty for points
};

/// What the placed ones saw, by common frames in the order of time, the reference camera's tracks
/// first; `recording` is the reference camera's.
[[nodiscard]] SeenTogether join_views(std::vector<LoneCamera> alone, const PlacedCameras& placed,
                                      const SightOptions& options);

/// `see_alone`: how one camera's recording is seen. Cameras that show no marker, or none in common
/// with the others, are named in the warnings and left out. Throws undetermined when that leaves
/// none.
[[nodiscard]] SeenTogether see_cameras(const Recording& recording, const SightOptions& options,
                                       const std::function<SeenAlone(const Recording&)>& see_alone);

/// Of the common frames' observations, every camera by its own model and pose, in the reference
/// camera's frame.
[[nodiscard]] PoseTracks tracks_of_cameras(const TagObservations& tags,
                                           const Calibration& calibration,
                                           const MarkerSet& markers);

}  // namespace kinescope
