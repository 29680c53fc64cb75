// SPDX-License-Identifier: Apache-2.0
//
// Takes   a calibrated robot, the joint log, and the channels that drive nothing.
// Gives   joints that no channel drives as a whole and that follow one up to an instant, or from
//         one on: a reading that froze, columns that were exchanged, a sign that turned round.
// Method  every joint's value against every channel, a line before an instant and another behind
//         it, as Bayes' criterion has them (Schwarz 1978); from sums, so that all instants are
//         tried.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/bundle/calibration.h"
#include "kinematics/log/joint_log.h"

namespace kinescope {

/// value = scale * reading + offset, rad or m, from one frame to another, both inside.
struct FollowedPart {
  int channel = -1;  ///< index into JointLog::channels
  double scale = 1.0;
  double offset = 0.0;
  double from_s = 0.0;  ///< on the log's clock
  double to_s = 0.0;
};

struct PartlyFollowed {
  std::size_t joint = 0;             ///< index into Calibration::tree.joints
  std::vector<FollowedPart> before;  ///< the part up to the instant; one at most
  std::vector<FollowedPart> after;   ///< the part behind it; one at most, one of both at least
};

/// `idle`: the channels to look among.
[[nodiscard]] std::vector<PartlyFollowed> partly_followed(const Calibration& calibration,
                                                          const JointLog& log,
                                                          const std::vector<int>& idle);

/// The log as it would be without that, each joint on the channel that it follows first: nothing
/// where one of them follows none in one part, or two of them begin with the same.
[[nodiscard]] std::optional<JointLog> with_readings_mended(
    const JointLog& log, const std::vector<PartlyFollowed>& joints);

/// "joint2 follows 'j2' up to t = 12.0, and 'j3' from there on".
[[nodiscard]] std::string words_of(const PartlyFollowed& followed, const Calibration& calibration,
                                   const JointLog& log);

}  // namespace kinescope
