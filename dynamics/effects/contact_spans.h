// SPDX-License-Identifier: Apache-2.0
//
// Stretches of a log in which something else pushed the robot: short, strong bursts in what a model
// of its torques leaves, against the level of all the rest. They are left out of a trace, not
// explained; dynamics/contact detects contacts as they happen.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "dynamics/effects/effect_motion.h"

namespace kinescope {

struct ContactSpanOptions {
  double window_s = 0.1;  ///< over which a burst is summed
  /// Level of a burst, in robust standard deviations of the logarithm of the residual's power
  /// above its median. Noise stays below 4; what a model lacks is felt all over the log and widens
  /// the deviation.
  double level = 6.0;
  double end_level = 2.5;    ///< below which a burst has ended
  double most_share = 0.25;  ///< of the time: more than that is no burst but how the robot moves
};

/// From one sample to another of a trajectory.
struct ContactSpan {
  double from_s = 0.0;  ///< on the laid-out clock of the motion
  double to_s = 0.0;
  LogMoment from = {};  ///< the same as the log has it
  LogMoment to = {};
  Eigen::VectorXd peak = {};         ///< largest residual torque of each joint, with its sign
  Eigen::VectorXd noise_ratio = {};  ///< its size over the noise of the joint
};

/// `whitened`: instants x joints, `sigma` of each joint. In the order of time.
[[nodiscard]] std::vector<ContactSpan> find_contact_spans(const EffectMotion& motion,
                                                          const Eigen::MatrixXd& whitened,
                                                          const Eigen::VectorXd& sigma,
                                                          const ContactSpanOptions& options = {});

/// One flag a sample: 0 within a span and `margin_s` around it.
[[nodiscard]] std::vector<char> outside_spans(const EffectMotion& motion,
                                              const std::vector<ContactSpan>& spans,
                                              double margin_s);

}  // namespace kinescope
