// SPDX-License-Identifier: Apache-2.0
//
// A pole on a cart: Deisenroth 2010 ("Efficient Reinforcement Learning using Gaussian Processes",
// appendix C.2). The pole is a uniform rod and hangs at angle 0; a force moves the cart.
#pragma once

#include "dynamics/policy/systems/mechanism.h"

namespace kinescope::policy {

/// Values of the benchmark of PILCO and MC-PILCO.
struct CartPole {
  double cart_kg = 0.5;
  double pole_kg = 0.5;
  double length_m = 0.5;       ///< of the pole
  double friction_ns_m = 0.1;  ///< of the cart, viscous
  double force_limit_n = 10.0;
  double step_s = 0.05;
};

/// Positions: cart (m), pole (rad). Input: force (N).
[[nodiscard]] Mechanism cart_pole(const CartPole& values = {});

}  // namespace kinescope::policy
