// SPDX-License-Identifier: Apache-2.0
//
// How much of an effect each frame shows, from how the joints move.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/bundle/effect_bundle.h"

namespace kinescope::effects {

/// A joint's value at the log's samples where `channel`, a column in the unit of its own one, says
/// where it is; columns that it is coupled to and that the log lacks count as 0.
[[nodiscard]] Eigen::VectorXd joint_values(const JointLog& log, const Joint& joint, int channel);

/// Joint values that the log says, and their rates, at its own samples; 0 for joints without a
/// column.
[[nodiscard]] JointMotion motion_of(const JointLog& log, const KinematicTree& tree);

/// Where the play of a gear stands: -1/2 when the drive has last pushed the link forwards, 1/2 when
/// backwards, in between while the gap is crossed; link = drive + width x this. `width` in the
/// unit of `drive`. Visintin 1994, section III.2 (the play operator).
[[nodiscard]] Eigen::VectorXd play_state(const Eigen::VectorXd& drive, double width);

/// The same of a link that began `start` ahead of its drive, which is what it is for as long as the
/// drive has not pushed it.
struct StartedPlay {
  Eigen::VectorXd state;
  Eigen::VectorXd unmoved;  ///< 1 until the drive pushes the link, then 0: d link / d start
};
[[nodiscard]] StartedPlay play_from(const Eigen::VectorXd& drive, double width, double start);

/// What a link that began elsewhere in its gap than play_state() has it is further by, as a share
/// of that at the beginning: until the drive has crossed the gap once. From the middle of the gap;
/// from elsewhere nearly so.
[[nodiscard]] Eigen::VectorXd share_of_start(const Eigen::VectorXd& drive, double width);

/// `values` at the stamps `from_s`, read at `to_s` (both increasing); the ends stay.
[[nodiscard]] Eigen::VectorXd read_at(const std::vector<double>& from_s,
                                      const Eigen::VectorXd& values,
                                      const std::vector<double>& to_s);

/// When a motion's instants read the joint, by the log.
[[nodiscard]] std::vector<double> read_times(const JointMotion& motion, int joint);

/// A load that a joint may give way under.
struct Load {
  std::string what;       ///< "its own link, across x"
  Eigen::VectorXd arm_m;  ///< instants: torque of 1 kg under a unit of gravity (sliders: its force)
};

/// A load with less of an arm is none, m.
inline constexpr double kNoArm = 1e-9;

/// What gravity does to a joint from the places where masses may be: with a known gravity from
/// every place that matters (up to two a link), else from one in the middle of all links behind
/// it, for gravity along each axis of the base.
[[nodiscard]] std::vector<Load> gravity_loads(const KinematicTree& tree, const JointMotion& motion,
                                              int joint,
                                              const std::optional<Eigen::Vector3d>& gravity_base);

}  // namespace kinescope::effects
