// SPDX-License-Identifier: Apache-2.0
//
// A plant in its servo loop: proportional and derivative action with feed-forward, at the
// controller's rate, with its delay, encoders, torque limits and torque noise.
#pragma once

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
  bool feed_forward = true;    ///< the torque of the bodies along the reference, without the drives
  double delay_s = 0.0;        ///< from measurement to torque; rounded to periods
  double encoder_step = 0.0;   ///< rad or m; positions are multiples of it; 0: exact
  Eigen::VectorXd torque_limit = {};  ///< N m or N, one a joint; empty: none
  double torque_noise = 0.0;          ///< standard deviation of measured torques, N m or N
};

/// Throws bad_request for options out of range or of another robot.
void check_options(const ServoOptions& options, Eigen::Index joints);

/// Gains of every joint for a bandwidth w: kp = m w^2, kd = 2 m w, with 1 / m the joint's own entry
/// of the inverse mass matrix at a posture.
struct ServoGains {
  Eigen::VectorXd kp, kd;
};
[[nodiscard]] ServoGains servo_gains(const Plant& plant, const Eigen::VectorXd& q,
                                     double bandwidth_hz);

struct ServoLog {
  TorqueSamples samples;           ///< as the robot logs it: encoders, true speeds, measured torque
  Eigen::VectorXd tracking_error;  ///< rms, rad or m
};

/// Follows `reference` (one trajectory, even steps of 1 / rate), from its first posture and speed.
/// A torque is logged at the mean of what is applied before and after its stamp. Throws
/// undetermined where the loop is not stable.
[[nodiscard]] ServoLog run_servo(const Plant& plant, const TorqueSamples& reference,
                                 const ServoOptions& options, Rng& rng);

}  // namespace kinescope
