// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/double_pendulum.h"

#include <cmath>

namespace kinescope::policy {

Mechanism double_pendulum(MotorAt motor, const DoublePendulum& values) {
  const bool elbow = motor == MotorAt::kElbow;
  Mechanism out{.name = elbow ? "acrobot" : "pendubot", .layout = {}, .terms = {}};
  out.layout = {.positions = {"shoulder", "elbow"},
                .is_angle = {true, true},
                .inputs = {"torque"},
                .input_limit = Eigen::VectorXd::Constant(1, values.torque_limit_nm),
                .step_s = values.step_s};
  out.terms = [values, elbow](const Eigen::VectorXd& p, const Eigen::VectorXd& dp,
                              const Eigen::VectorXd& u) {
    const double coupling = values.lower_kg * values.upper_m * values.lower_centre_m;
    const double cosine = coupling * std::cos(p[1]);
    const double sine = coupling * std::sin(p[1]);
    const double upper = values.upper_kg * values.upper_centre_m + values.lower_kg * values.upper_m;
    const double lower = values.lower_kg * values.lower_centre_m;
    const double shoulder_inertia =
        values.upper_kgm2 + values.lower_kgm2 + values.lower_kg * values.upper_m * values.upper_m;
    const double pull = kPlantGravity_m_s2 * lower * std::sin(p[0] + p[1]);
    MotionTerms terms = MotionTerms::zero(2);
    terms.mass << shoulder_inertia + 2.0 * cosine, values.lower_kgm2 + cosine,
        values.lower_kgm2 + cosine, values.lower_kgm2;
    terms.force << (elbow ? 0.0 : u[0]) + sine * dp[1] * (2.0 * dp[0] + dp[1]) -
                       kPlantGravity_m_s2 * upper * std::sin(p[0]) - pull -
                       values.damping_nms * dp[0],
        (elbow ? u[0] : 0.0) - sine * dp[0] * dp[0] - pull - values.damping_nms * dp[1];
    terms.potential_j =
        -kPlantGravity_m_s2 * (upper * std::cos(p[0]) + lower * std::cos(p[0] + p[1]));
    return terms;
  };
  return out;
}

}  // namespace kinescope::policy
