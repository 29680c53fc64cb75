// SPDX-License-Identifier: Apache-2.0
//
// Takes   the markers' images, and what was declared of the camera and the markers.
// Gives   other cameras and other markers, where the images speak for them whatever carries the
//         markers: a focal length that is far off, a marker that is not flat bend the tracks that
//         the structure is searched for on, one of another size hangs nowhere.
// Method  each view with a pose of its own: calib/tracks/camera_from_tags.h, shown_shapes.h; two
//         markers about a shared point: shown_sizes.h. They propose; what predicts the recording
//         better is for whoever asks to judge.
#pragma once

#include <vector>

#include "app/explain/pipeline.h"

namespace kinescope {

/// What tracks are made with.
struct Sight {
  CameraModel camera;
  MarkerSet markers;
  bool is_camera_free = false;       ///< to be estimated with the robot
  std::vector<AddedEffect> told_by;  ///< effects that say the same of what was declared
};

/// The camera as the first robot that shows with it has it, from what the images say or from the
/// declared one; nothing where none shows, or none was declared.
[[nodiscard]] std::optional<Sight> with_other_camera(const Recording& recording,
                                                     const Observed& observed,
                                                     const CameraModel& declared,
                                                     const CalibrateOptions& options);

/// The same where the images are more probable with the camera that they show than with the
/// declared one: by more than half of the odds, whatever they are worth, for what is tried first.
[[nodiscard]] std::optional<Sight> with_shown_camera(const Recording& recording,
                                                     const Observed& observed,
                                                     const CameraModel& declared,
                                                     const CalibrateOptions& options);

/// Markers that are not flat squares; nothing where all are.
[[nodiscard]] std::optional<Sight> with_other_markers(const Recording& recording,
                                                      const Observed& observed,
                                                      const CameraModel& declared);

/// Markers of other sizes, as motion about shared points shows them; nothing where all are as
/// declared. `tracks`: of the declared sizes.
[[nodiscard]] std::optional<Sight> with_other_sizes(const Recording& recording,
                                                    const Observed& observed,
                                                    const PoseTracks& tracks,
                                                    const CameraModel& declared);

}  // namespace kinescope
