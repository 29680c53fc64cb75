// SPDX-License-Identifier: Apache-2.0
//
// Takes   poses of one target in the camera's frame beside the motion that carries it.
// Gives   starts for both unknown transforms of T_camera_target = X^-1 B Y, from several solvers:
//         none is right on every real set, so that all are run and the one that closes best is
//         kept.
// Method  A X = X C over pairs of frames (Park and Martin 1994); X T = B Y over frames by Kronecker
//         products (Shah 2013); rotations and translations together, from everywhere
//         (calib/bundle/hand_eye.h). Each again over the frames that closed best, as one flipped
//         planar pose moves a plain least squares.
// Internal to the room.
#pragma once

#include <optional>
#include <vector>

#include "kinematics/core/pose.h"

namespace kinescope::hand_eye {

/// One frame of one target.
struct MotionPair {
  Pose B;
  Pose T_camera_target;
  std::optional<Pose> alternative;  ///< the other planar pose
};

struct HandEyeStart {
  Pose X;  ///< T_mount_camera
  Pose Y;  ///< T_foot_target
  /// Median over the frames of what stays open, m and rad together at arm's length (1 m).
  double misfit = 0.0;
  const char* solver = "";
};

/// The best start, over all solvers. Nothing with fewer than three pairs.
[[nodiscard]] std::optional<HandEyeStart> closed_form(std::vector<MotionPair> pairs);

/// The same by the linear solvers alone, for a first comparison of many readings.
[[nodiscard]] std::optional<HandEyeStart> linear_closed_form(std::vector<MotionPair> pairs);

/// Y of the least misfit where X is known, median-trimmed; its misfit in `misfit`.
[[nodiscard]] HandEyeStart target_for(std::vector<MotionPair> pairs, const Pose& X);

}  // namespace kinescope::hand_eye
