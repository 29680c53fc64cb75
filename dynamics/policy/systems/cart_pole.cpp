// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/cart_pole.h"

#include <cmath>

namespace kinescope::policy {

Mechanism cart_pole(const CartPole& values) {
  Mechanism out{.name = "cart-pole", .layout = {}, .terms = {}};
  out.layout = {.positions = {"cart", "pole"},
                .is_angle = {false, true},
                .inputs = {"force"},
                .input_limit = Eigen::VectorXd::Constant(1, values.force_limit_n),
                .step_s = values.step_s};
  out.terms = [values](const Eigen::VectorXd& p, const Eigen::VectorXd& dp,
                       const Eigen::VectorXd& u) {
    const double half = 0.5 * values.pole_kg * values.length_m;  // mass times centre of mass
    const double sine = std::sin(p[1]);
    const double cosine = std::cos(p[1]);
    MotionTerms terms = MotionTerms::zero(2);
    terms.mass << values.cart_kg + values.pole_kg, half * cosine, half * cosine,
        values.pole_kg * values.length_m * values.length_m / 3.0;
    terms.force << u[0] - values.friction_ns_m * dp[0] + half * sine * dp[1] * dp[1],
        -half * kPlantGravity_m_s2 * sine;
    terms.potential_j = -half * kPlantGravity_m_s2 * cosine;
    return terms;
  };
  return out;
}

}  // namespace kinescope::policy
