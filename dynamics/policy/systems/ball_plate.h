// SPDX-License-Identifier: Apache-2.0
//
// A ball that rolls on a plate which two servos tilt: Awtar and others 2002 ("Mechatronic design of
// a ball-on-plate balancing system"), in full: the ball rolls without slipping and does not spin
// about the plate's normal, its centre passes through the axes of the plate, and the plate has no
// edge.
#pragma once

#include "dynamics/policy/systems/mechanism.h"

namespace kinescope::policy {

/// A steel ball of 20 mm on an aluminium plate of 0.3 m.
struct BallPlate {
  double ball_kg = 0.0327;
  double rolling_share = 0.4;  ///< inertia of the ball over mass and radius squared: solid
  double rolling_damping_ns_m = 0.01;
  double plate_kgm2 = 3.75e-3;    ///< about its axes; twice that about its normal
  double servo_hz = 8.0;          ///< of the position loop, critically damped
  double angle_limit_rad = 0.15;  ///< of the reference
  double step_s = 1.0 / 30.0;
};

/// Positions: ball x, y in the plate (m), roll (about the fixed x axis) and pitch (about the
/// plate's y axis) of the plate (rad). Inputs: what the servos are told (rad).
[[nodiscard]] Mechanism ball_plate(const BallPlate& values = {});

}  // namespace kinescope::policy
