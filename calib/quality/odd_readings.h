// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibrated robot, the marker poses and the log it was calibrated from.
// Gives   single readings that contradict all the markers they move, with what those say instead.
// Method  in a frame that lost every marker behind a joint as an outlier, and none before it, the
//         joint's value from each marker's pose alone: one of them that brings the markers back is
//         the reading that was wrong.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/bundle/calibration.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

struct OddReading {
  double time_s = 0.0;  ///< of the frame
  std::string channel;
  double read = 0.0;      ///< in the channel's unit
  double expected = 0.0;  ///< the same
};

/// What the markers behind a channel's joint say that it should have read in a frame, in its unit;
/// nothing where they do not agree, or none is seen.
[[nodiscard]] std::optional<double> reading_shown(const Calibration& calibration,
                                                  const PoseTracks& tracks, int frame,
                                                  const std::string& channel);

/// In the order of frames.
[[nodiscard]] std::vector<OddReading> odd_readings(const Calibration& calibration,
                                                   const PoseTracks& tracks, const JointLog& log);

}  // namespace kinescope
