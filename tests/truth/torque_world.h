// SPDX-License-Identifier: Apache-2.0
//
// Joint logs with torques of a known robot: smooth random motion, friction, noise that is coloured
// in time.
#pragma once

#include "dynamics/data/torque_samples.h"
#include "dynamics/identify/torque_terms.h"
#include "kinematics/core/rng.h"
#include "kinematics/model/dynamic_model.h"
#include "tests/truth/random_dynamics.h"

namespace kinescope {

struct TorqueWorldOptions {
  int samples = 2000;
  double rate_hz = 100.0;
  double amplitude_rad = 1.5;  ///< prismatic joints: 0.2 m a rad
  double highest_hz = 0.8;     ///< of ten sines a joint
  double noise = 0.01;         ///< standard deviation, share of each joint's rms torque
  double noise_memory = 0.0;   ///< correlation of the noise from sample to sample (AR(1)), 0 to 1
  double common_noise = 0.0;   ///< share of the noise's variance that all joints have in common
  double outliers = 0.0;       ///< share of torques thrown off by up to ten rms
  int trajectories = 2;
  Eigen::VectorXd offsets = {};  ///< constant torque a joint; empty: none
  double coulomb_width_rad_s = 0.01;
  double coulomb_width_m_s = 0.002;
};

/// torque = rigid bodies + motors + friction of model.joints + offsets + noise.
[[nodiscard]] TorqueSamples torque_log_of(const DynamicModel& model,
                                          const TorqueWorldOptions& options, Rng& rng);

}  // namespace kinescope
