// SPDX-License-Identifier: Apache-2.0
//
// Takes   the equations of motion of a mechanism with few degrees of freedom.
// Gives   its accelerations, its energy, its motion under an input that is held.
// Units   SI; P positions (rad or m), U inputs, states x = (p, dp) as in dynamics/policy/system.h.
// Method  M(p) ddp = f(p, dp, u); Runge-Kutta of order 4.
// Not here: what is measured of it (simulated_system.h).
#pragma once

#include <functional>
#include <string>

#include <Eigen/Core>

#include "dynamics/policy/system.h"

namespace kinescope::policy {

/// Standard gravity as the literature's plants have it.
inline constexpr double kPlantGravity_m_s2 = 9.81;

/// The equations at one state.
struct MotionTerms {
  Eigen::MatrixXd mass;      ///< P x P, symmetric, positive definite
  Eigen::VectorXd force;     ///< P: all but M ddp
  double potential_j = 0.0;  ///< of gravity

  [[nodiscard]] static MotionTerms zero(Eigen::Index positions) {
    return {Eigen::MatrixXd::Zero(positions, positions), Eigen::VectorXd::Zero(positions), 0.0};
  }
};

struct Mechanism {
  std::string name;
  StateLayout layout;
  /// From positions (P), speeds (P), inputs (U).
  std::function<MotionTerms(const Eigen::VectorXd& p, const Eigen::VectorXd& dp,
                            const Eigen::VectorXd& u)>
      terms;
};

/// ddp (P) at a state (2 P) under an input (U).
[[nodiscard]] Eigen::VectorXd acceleration(const Mechanism& mechanism, const Eigen::VectorXd& state,
                                           const Eigen::VectorXd& input);

/// Kinetic and potential, J.
[[nodiscard]] double energy_j(const Mechanism& mechanism, const Eigen::VectorXd& state);

/// The state after `step_s` in `substeps` equal steps of Runge and Kutta, with the input held.
[[nodiscard]] Eigen::VectorXd move(const Mechanism& mechanism, Eigen::VectorXd state,
                                   const Eigen::VectorXd& input, double step_s, int substeps);

}  // namespace kinescope::policy
