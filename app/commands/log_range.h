// SPDX-License-Identifier: Apache-2.0
//
// Another log of the robot, held against the range of joint values that the run saw.
#pragma once

#include <string>
#include <vector>

#include "app/io/effects_file.h"
#include "calib/effects/corrected_log.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// A sentence for each joint that leaves the range in which effects of it were seen (`faded`), and
/// for each other one that leaves the range seen by more than a tenth of it. `in_si`: the log with
/// `found.unit_factors` applied. Joints without a column or a known range are passed over.
/// Throws bad_input for a joint that turns and whose readings are in degrees.
[[nodiscard]] std::vector<std::string> range_warnings(const JointLog& in_si,
                                                      const KinematicTree& tree,
                                                      const CalibratedEffects& found,
                                                      const std::vector<FadedEffect>& faded);

}  // namespace kinescope
