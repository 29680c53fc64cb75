// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/mechanism.h"

#include <Eigen/Cholesky>

namespace kinescope::policy {
namespace {

MotionTerms terms_at(const Mechanism& mechanism, const Eigen::VectorXd& state,
                     const Eigen::VectorXd& input) {
  const Eigen::Index count = mechanism.layout.position_count();
  return mechanism.terms(state.head(count), state.tail(count), input);
}

Eigen::VectorXd derivative(const Mechanism& mechanism, const Eigen::VectorXd& state,
                           const Eigen::VectorXd& input) {
  const Eigen::Index count = mechanism.layout.position_count();
  Eigen::VectorXd out(2 * count);
  out << state.tail(count), acceleration(mechanism, state, input);
  return out;
}

}  // namespace

Eigen::VectorXd acceleration(const Mechanism& mechanism, const Eigen::VectorXd& state,
                             const Eigen::VectorXd& input) {
  const MotionTerms terms = terms_at(mechanism, state, input);
  return terms.mass.llt().solve(terms.force);
}

double energy_j(const Mechanism& mechanism, const Eigen::VectorXd& state) {
  const MotionTerms terms =
      terms_at(mechanism, state, Eigen::VectorXd::Zero(mechanism.layout.input_count()));
  const Eigen::VectorXd dp = state.tail(mechanism.layout.position_count());
  return 0.5 * dp.dot(terms.mass * dp) + terms.potential_j;
}

Eigen::VectorXd move(const Mechanism& mechanism, Eigen::VectorXd state,
                     const Eigen::VectorXd& input, double step_s, int substeps) {
  const double h = step_s / substeps;
  for (int k = 0; k < substeps; ++k) {
    const Eigen::VectorXd k1 = derivative(mechanism, state, input);
    const Eigen::VectorXd k2 = derivative(mechanism, state + 0.5 * h * k1, input);
    const Eigen::VectorXd k3 = derivative(mechanism, state + 0.5 * h * k2, input);
    const Eigen::VectorXd k4 = derivative(mechanism, state + h * k3, input);
    state += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  }
  return state;
}

}  // namespace kinescope::policy
