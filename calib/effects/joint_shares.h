// SPDX-License-Identifier: Apache-2.0
//
// How much of an effect each frame shows, from how the joints move.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "calib/bundle/effect_bundle.h"

namespace kinescope::effects {

/// Where the play of a gear stands: -1/2 when the drive has last pushed the link forwards, 1/2 when
/// backwards, in between while the gap is crossed; link = drive + width x this. `width` in the
/// unit of `drive`. Visintin 1994, section III.2 (the play operator).
[[nodiscard]] Eigen::VectorXd play_state(const Eigen::VectorXd& drive, double width);

/// `values` at the stamps `from_s`, read at `to_s` (both increasing); the ends stay.
[[nodiscard]] Eigen::VectorXd read_at(const std::vector<double>& from_s,
                                      const Eigen::VectorXd& values,
                                      const std::vector<double>& to_s);

/// Torque about (force along) a joint's axis that 1 kg of load causes under a unit of gravity along
/// each axis of the base frame: instants x 3. Of the load, the share `at_tip` hangs on the last
/// link of the joint's branch, the rest is spread evenly over the frames of the links behind the
/// joint.
[[nodiscard]] Eigen::Matrix<double, Eigen::Dynamic, 3> gravity_load(const KinematicTree& tree,
                                                                    const JointMotion& motion,
                                                                    int joint, double at_tip);

}  // namespace kinescope::effects
