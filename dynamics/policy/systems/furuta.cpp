// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/furuta.h"

#include <cmath>

namespace kinescope::policy {

Mechanism furuta(const Furuta& values) {
  Mechanism out{.name = "Furuta pendulum", .layout = {}, .terms = {}};
  out.layout = {.positions = {"arm", "pole"},
                .is_angle = {true, true},
                .inputs = {"voltage"},
                .input_limit = Eigen::VectorXd::Constant(1, values.voltage_limit_v),
                .step_s = values.step_s};
  out.terms = [values](const Eigen::VectorXd& p, const Eigen::VectorXd& dp,
                       const Eigen::VectorXd& u) {
    const double arm = values.arm_kg * values.arm_m * values.arm_m / 3.0 +
                       values.pole_kg * values.arm_m * values.arm_m;           // J0 hat
    const double pole = values.pole_kg * values.pole_m * values.pole_m / 3.0;  // J2 hat
    const double half = 0.5 * values.pole_kg * values.pole_m;
    const double coupling = half * values.arm_m;
    const double torque = values.motor_nm_a / values.motor_ohm * (u[0] - values.motor_nm_a * dp[0]);
    const double sine = std::sin(p[1]);
    const double cosine = std::cos(p[1]);
    const double twice = std::sin(2.0 * p[1]);
    MotionTerms terms = MotionTerms::zero(2);
    terms.mass << arm + pole * sine * sine, coupling * cosine, coupling * cosine, pole;
    terms.force << torque - values.arm_damping_nms * dp[0] - pole * twice * dp[0] * dp[1] +
                       coupling * sine * dp[1] * dp[1],
        0.5 * pole * twice * dp[0] * dp[0] - half * kPlantGravity_m_s2 * sine -
            values.pole_damping_nms * dp[1];
    terms.potential_j = -half * kPlantGravity_m_s2 * cosine;
    return terms;
  };
  return out;
}

}  // namespace kinescope::policy
