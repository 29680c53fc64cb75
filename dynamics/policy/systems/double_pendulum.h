// SPDX-License-Identifier: Apache-2.0
//
// Two links in a row with one motor: acrobot (at the elbow) and pendubot (at the shoulder). Spong
// 1995 ("The swing up control problem for the acrobot", equations 1 to 7). Both links hang at
// angle 0; the second angle is relative to the first link.
#pragma once

#include "dynamics/policy/systems/mechanism.h"

namespace kinescope::policy {

enum class MotorAt { kShoulder, kElbow };

/// Values of the real-robot competition of Wiebe and others 2024 ("AI Olympics with RealAIGym",
/// design C.1, its simulation stage: no friction, no motor inertia).
struct DoublePendulum {
  double upper_kg = 0.52346;
  double lower_kg = 0.62557;
  double upper_m = 0.2;         ///< from joint to joint
  double upper_centre_m = 0.2;  ///< from the joint to the centre of mass
  double lower_centre_m = 0.25569;
  double upper_kgm2 = 0.031887;  ///< about the shoulder
  double lower_kgm2 = 0.050870;  ///< about the elbow
  double damping_nms = 0.0;      ///< of either joint
  double torque_limit_nm = 6.0;
  double step_s = 0.02;
};

/// Positions: shoulder, elbow (rad). Input: torque (N m).
[[nodiscard]] Mechanism double_pendulum(MotorAt motor, const DoublePendulum& values = {});

}  // namespace kinescope::policy
