// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibrated robot, the marker poses and the log it was calibrated from.
// Gives   readings that contradict the markers they move, with what those say instead.
// Method  in a frame that lost markers as outliers, the values of all joints from the markers'
// poses
//         alone (least squares); the fewest of them that bring the markers back, no more than there
//         are markers lost, are the readings that were wrong.
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

/// Odd readings in successive frames: some that froze, fell to zero, came late or twice.
struct OddStretch {
  std::vector<std::string> channels;  ///< that were wrong together
  double from_s = 0.0;                ///< of the first frame, on the log's clock
  double to_s = 0.0;                  ///< of the last one
  int frames = 0;
  /// Of the first channel, where reading and markers differ most; on the log's clock.
  OddReading most;
  bool stands_still = false;  ///< one value of each, or one row, in all of them
  /// The log has the same rows so long before, s.
  std::optional<double> repeats_s = {};
  /// The log has what the markers show, but so much later (earlier where negative), s.
  std::optional<double> late_s = {};

  /// The log itself says what is wrong there.
  [[nodiscard]] bool is_told_by_log() const { return stands_still || repeats_s || late_s; }
};

/// Of at least two frames of a film, in the order of time. O(rows^2) at worst, where rows repeat.
[[nodiscard]] std::vector<OddStretch> odd_stretches(const Calibration& calibration,
                                                    const JointLog& log,
                                                    const std::vector<OddReading>& readings);

/// For a user, a line for those of the same channels.
[[nodiscard]] std::vector<std::string> lines_of(const std::vector<OddStretch>& stretches,
                                                const JointLog& log);

}  // namespace kinescope
