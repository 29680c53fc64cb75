// SPDX-License-Identifier: Apache-2.0
//
// A plant in its servo loop: a controller at its rate, with delay, encoders, torque limits and
// torque noise. The only loop: `simulate` and `control` run it.
#pragma once

#include "dynamics/control/controller.h"
#include "dynamics/data/torque_samples.h"
#include "dynamics/simulation/plant.h"
#include "kinematics/core/rng.h"

namespace kinescope {

struct ServoOptions {
  double rate_hz = 1000.0;     ///< of the controller, which holds its torque over a period
  int steps = 2;               ///< of the simulation a period
  double bandwidth_hz = 10.0;  ///< of the position loop, where gains are not given
  Eigen::VectorXd kp = {};     ///< N m/rad or N/m, one a joint; empty: from the bandwidth
  Eigen::VectorXd kd = {};     ///< N m s/rad or N s/m; empty: critically damped
  ControlLaw law = ControlLaw::kFeedForward;
  double velocity_cutoff_hz = 0.0;  ///< of VelocityEstimator; 0: the true speed, as of a tachometer
  double delay_s = 0.0;             ///< from measurement to torque; rounded to periods
  double encoder_step = 0.0;        ///< rad or m; positions are multiples of it; 0: exact
  Eigen::VectorXd torque_limit = {};       ///< N m or N, one a joint; empty: none
  Eigen::VectorXd torque_rate_limit = {};  ///< N m/s or N/s, one a joint; empty: none
  double torque_noise = 0.0;               ///< standard deviation of measured torques, N m or N
};

/// Throws bad_request for options out of range, of another robot, or that contradict each other.
void check_options(const ServoOptions& options, Eigen::Index joints);

/// One entry a joint.
struct ServoLog {
  TorqueSamples samples;                ///< as the robot logs it: encoders, speeds, measured torque
  Eigen::VectorXd tracking_error = {};  ///< rms, rad or m
  Eigen::VectorXd largest_error = {};   ///< rad or m
  Eigen::VectorXd feedback = {};        ///< rms of its torque, N m or N
  Eigen::VectorXd torque = {};          ///< rms of the command, N m or N
  Eigen::VectorXd weight = {};          ///< mean of the learned part's, 0 to 1
  Eigen::VectorXi limited = {};         ///< periods in which a limit held
};

/// Follows `reference` (one trajectory, even steps of 1 / rate), from its first posture and speed.
/// A torque is logged at the mean of what is applied before and after its stamp. Throws
/// undetermined where the loop is not stable, and what Controller throws. O(samples).
[[nodiscard]] ServoLog run_servo(const Plant& plant, const TorqueSamples& reference,
                                 const KnownRobot& robot, const ServoOptions& options, Rng& rng);

/// The controller knows the plant's masses, not its friction.
[[nodiscard]] ServoLog run_servo(const Plant& plant, const TorqueSamples& reference,
                                 const ServoOptions& options, Rng& rng);

}  // namespace kinescope
