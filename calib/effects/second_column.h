// SPDX-License-Identifier: Apache-2.0
//
// Takes   a joint log, and the robot with the columns that tell a joint's value again.
// Gives   SecondColumn: how such a column differs from the one that the robot was made with (early
//         or late, drooping, dead-banded, scaled, in steps) and by how much.
// Units   rad or m, s.
// Method  calib/trace over the samples of the log (traced_columns.h).
// Not here: which columns those are and which of them the markers follow
//         (kinematics/structure/copied_channels.h).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/trace/trace_result.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

struct SecondColumn {
  std::string column;
  std::string channel;  ///< the joint's own
  std::string joint;
  std::string unit;     ///< of the joint's value
  double offset = 0.0;  ///< mean of column minus channel
  double before = 0.0;  ///< rms of the difference about that
  double after = 0.0;   ///< rms of what no effect explains
  double noise = 0.0;   ///< of that, what neighbouring samples do not share; postures: 0
  bool lifted = false;  ///< a droop goes against gravity: the channel is ahead, not behind
  /// time_offset: by how much the column is ahead, s. droop: of the channel behind the column, the
  /// most in the recording. acceleration_lag: likewise, behind. dead_band: the width, of the joint
  /// behind the column or, with that as its place, the other way round. encoder_scale: by how much
  /// the column says more. quantisation: of the column.
  Trace trace = {};
};

/// Of every joint's copies (`Joint`); columns that the log does not have are passed over.
/// `gravity_base`: unit vector along which things fall, where
/// it is known. `postures`: samples at rest, one by one; no delay, no dead band.
[[nodiscard]] std::vector<SecondColumn> second_columns(
    const JointLog& log, const KinematicTree& tree,
    const std::optional<Eigen::Vector3d>& gravity_base, bool postures);

/// "q1_cmd is 60.0 (59.8 to 60.2) ms ahead of q1; q1 stays behind q1_cmd by up to 1.90 (1.88 to
/// 1.92)° under load; what is left, 0.0050°, is noise".
[[nodiscard]] std::string words_of(const SecondColumn& second);

}  // namespace kinescope
