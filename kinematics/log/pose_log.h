// SPDX-License-Identifier: Apache-2.0
//
// Takes   poses with their times, as a robot's controller logs those of its flange.
// Gives   PoseLog, and poses between its rows.
// Method  four-point (Catmull-Rom) interpolation of rotation vectors and translations about the row
//         before: smooth within a row's step, continuous across rows.
// Not here: what the poses are of (calib/hand_eye), files (app/io).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/core/pose.h"
#include "kinematics/log/joint_log.h"

namespace kinescope {

struct PoseLog {
  std::string source;              ///< file name, for messages; empty when made by hand
  std::string time_column = "t";   ///< its name in the file
  bool numbered = false;           ///< `times_s` are numbers of rows or images, not of a clock
  std::vector<double> times_s;     ///< strictly increasing
  std::vector<Pose> poses;         ///< beside times_s
  std::vector<std::size_t> lines;  ///< of the file; empty when made by hand
};

/// A pose and its rate: pose(t + d) = pose exp(twist d) to first order, rad/s and m/s.
struct PoseAtTime {
  Pose pose;
  Vector6d twist = Vector6d::Zero();
};

/// Nothing before the first row, after the last, or inside a gap longer than `max_gap_s`. At a
/// row's own time its pose, whatever the gaps. O(log rows).
[[nodiscard]] std::optional<PoseAtTime> pose_at(const PoseLog& log, double time_s,
                                                double max_gap_s = kMaxGap);

/// Row i with the pose of row i + offset (a numbered log: of number n + offset), so far as there is
/// one.
[[nodiscard]] PoseLog with_rows_moved(PoseLog log, int offset);

/// As is_posture_log() of joints; always true for a numbered log.
[[nodiscard]] bool is_posture_log(const PoseLog& log, const std::vector<double>& times_s);

}  // namespace kinescope
