// SPDX-License-Identifier: Apache-2.0
//
// The rotary inverted pendulum of Furuta: Cazzolato and Prime 2011 ("On the Dynamics of the Furuta
// Pendulum", equations 33 and 34: slender links). The pole hangs at angle 0 and turns about the
// arm; a motor turns the arm.
#pragma once

#include "dynamics/policy/systems/mechanism.h"

namespace kinescope::policy {

/// Values of a Quanser QUBE-Servo 2 (its data sheet; damping as in its simulation model). Both
/// links are uniform rods.
struct Furuta {
  double arm_kg = 0.095;
  double arm_m = 0.085;  ///< from the motor to the pole
  double pole_kg = 0.024;
  double pole_m = 0.129;
  double arm_damping_nms = 2.7e-4;
  double pole_damping_nms = 5e-5;
  double motor_nm_a = 0.042;  ///< torque of a current, and volts of a speed (V s/rad)
  double motor_ohm = 8.4;
  double voltage_limit_v = 6.0;
  double step_s = 0.03;
};

/// Positions: arm, pole (rad). Input: voltage (V).
[[nodiscard]] Mechanism furuta(const Furuta& values = {});

}  // namespace kinescope::policy
