// SPDX-License-Identifier: Apache-2.0
//
// Robots whose drives stick: rest, start, reversal, slow sweeps, and an obstacle in the way of
// joint
// 1. Torque logs with exact truth. Motion is given, friction is Dahl's (1968) with a peak at low
// speed (Stribeck), whatever it was at rest; the torque follows by inverse dynamics.
#pragma once

#include "dynamics/experiments/contact_world.h"

namespace kinescope {

struct DriveWorldOptions {
  double duration_s = 20.0;
  double rate_hz = 250.0;
  double rest_s = 1.0;       ///< before the first move, and at most between two
  double speed_rad_s = 0.5;  ///< of the slowest joint's cruise; others are up to twice as fast
  bool one_way = false;      ///< joint 1 alone moves, at constant speed, after its rest
  double coulomb_nm = 1.0;   ///< of every joint
  double breakaway = 0.3;    ///< peak of friction at low speed, share of Coulomb friction
  double stribeck_rad_s = 0.01;
  double presliding_rad = 5e-4;
  double ripple_nm = 0.05;       ///< amplitude; spatial, twice a joint
  double obstacle_s = 0.0;       ///< when joint 1 meets an obstacle, with one_way; 0: never
  double obstacle_rise_s = 0.4;  ///< until the torque has risen by obstacle_nm
  double obstacle_nm = 1.0;
  double hold_s = 0.0;  ///< the log goes on that long after the rise, held; else ends there
  double position_quantum_rad = 1.2e-5;
  double velocity_sigma_rad_s = 1e-3;
  double torque_sigma_nm = 0.05;
};

[[nodiscard]] experiments::ContactWorld drive_world(const DynamicModel& model,
                                                    const DriveWorldOptions& options, Rng& rng);

}  // namespace kinescope
