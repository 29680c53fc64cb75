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

/// Odd readings of one channel in successive frames: a reading that froze, or fell to zero.
struct OddStretch {
  std::string channel;
  double from_s = 0.0;  ///< of the first frame, on the log's clock
  double to_s = 0.0;    ///< of the last one
  int frames = 0;
  OddReading most;            ///< where reading and markers differ most
  bool stands_still = false;  ///< it reads one value in all of them
};

/// Of at least two frames of a film, in the order of time.
[[nodiscard]] std::vector<OddStretch> odd_stretches(const Calibration& calibration,
                                                    const std::vector<OddReading>& readings);

}  // namespace kinescope
