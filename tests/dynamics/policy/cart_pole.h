// SPDX-License-Identifier: Apache-2.0
//
// A cart with a pole that hangs at angle 0, as an equation of motion of its own: the task on which
// MC-PILCO is compared in the literature (Amadio et al., T-RO 2022, section VI).
#pragma once

#include "dynamics/policy/mc_pilco.h"

namespace kinescope::policy {

struct CartPoleNumbers {
  double cart_kg = 0.5;
  double pole_kg = 0.5;
  double length_m = 0.5;
  double friction = 0.1;  ///< N s/m, of the cart
  double force_n = 10.0;
  double noise = 0.01;        ///< of all four measured states
  double start_sigma = 0.01;  ///< of all four states
};

class CartPole : public System {
 public:
  explicit CartPole(const CartPoleNumbers& numbers = {});
  [[nodiscard]] const StateLayout& layout() const override { return layout_; }
  [[nodiscard]] Trial run(const Controller& controller, int steps, std::uint64_t seed,
                          int trial) const override;

 private:
  CartPoleNumbers numbers_;
  StateLayout layout_;
};

/// 3 s; cost 1 - exp(-((|angle| - pi) / 3)^2 - (cart / 1 m)^2).
[[nodiscard]] PolicyTask cart_pole_task(const CartPoleNumbers& numbers = {});
/// In the last second the cart within 0.1 m of 0 and the pole within 10 degrees of upright.
[[nodiscard]] bool upright(const Trial& trial);

}  // namespace kinescope::policy
