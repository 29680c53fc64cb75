// SPDX-License-Identifier: Apache-2.0
//
// Takes   markers' poses in the camera's frame and a log.
// Gives   which of its columns are the pose of a flange in place of joint values, if they are.
// Method  of a marker on the hand before a fixed camera
//           R_camera_marker(i) = R_camera_base R_base_flange(i) R_flange_marker,
//         so that the rotation vector of the marker between two frames, in its own frame, is that
//         of the flange, turned by R_flange_marker: AX = XB (Shiu and Ahmad 1989). One rotation for
//         all pairs of frames is found in closed form (Kabsch 1976). A camera on the hand before
//         markers at rest is the same with the poses inverted.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/core/ids.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

struct FlangeColumns {
  std::vector<int> position;  ///< channels
  std::vector<int> rotation;
  std::string convention;  ///< of the rotation, in words
  bool inverted = false;   ///< the camera is on the hand, or the poses are those of the base in the
                           ///< flange's frame
  TagId marker;            ///< that turns as they say
  double misfit_rad = 0.0;  ///< rms, of its rotations between two frames
};

/// Nothing where the log has two channels or more beside a pose, where no marker turns about more
/// than one axis as a pose does, or where one moves with something else: a robot's link.
/// `offset_s`: clocks may be apart by up to that much.
[[nodiscard]] std::optional<FlangeColumns> flange_columns(const PoseTracks& tracks,
                                                          const JointLog& log, double offset_s);

}  // namespace kinescope
