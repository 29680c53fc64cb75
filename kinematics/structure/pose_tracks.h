// SPDX-License-Identifier: Apache-2.0
//
// The poses of markers (or of tracked bodies) over time, in the frame of the fixed camera (or
// tracker).
#pragma once

#include <optional>
#include <vector>

#include "kinematics/core/ids.h"
#include "kinematics/core/pose.h"

namespace kinescope {

/// One marker in one frame.
struct PoseSample {
  int frame = 0;                                    ///< index into PoseTracks::times_s
  Pose T_camera_marker;                             ///< the branch that is believed
  Matrix6d covariance = Matrix6d::Identity();       ///< of a right perturbation; rad, m
  std::optional<Pose> T_camera_marker_alternative;  ///< the other planar branch, where there is one
  double alternative_cost = 0.0;  ///< chi-square of the other branch minus this one's
  /// Of a right perturbation of the other branch; none: the first's, as the camera sees it.
  std::optional<Matrix6d> alternative_covariance = {};
};

struct PoseTrack {
  TagId id;
  std::vector<PoseSample> samples;  ///< by frame, each frame at most once
};

struct PoseTracks {
  std::vector<double> times_s;    ///< of every frame, strictly increasing
  std::vector<PoseTrack> tracks;  ///< by id
};

}  // namespace kinescope
