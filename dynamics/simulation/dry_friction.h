// SPDX-License-Identifier: Apache-2.0
//
// The friction impulses of one time step, implicit in the speed at its end, so that a joint that
// friction can hold is held. Time stepping of Moreau 1988; Acary and Brogliato 2008, chapter 10:
// the speeds minimise a strictly convex function, found element by element (Gauss-Seidel).
#pragma once

#include <vector>

#include <Eigen/Core>

namespace kinescope {

/// Friction along one row of speeds, as a monotone law of the speed at the end of a step.
struct DryElement {
  struct Presliding {
    double friction = 0.0, length = 1.0;
    double state = 0.0;  ///< Dahl's, at the step's beginning
  };
  double amplitude = 0.0;  ///< of Coulomb's law, >= 0
  double width = 0.0;      ///< 0: set-valued at rest
  double speed_before = 0.0;
  std::vector<Presliding> presliding = {};
};

/// Torques lambda and speeds u after the step.
struct DrySolution {
  Eigen::VectorXd torque;
  Eigen::VectorXd speed;
  int sweeps = 0;
};

class DryFrictionSolver {
 public:
  /// Solves u = free_speed - step W lambda, lambda_e in law_e(u_e). `compliance` W: symmetric,
  /// elements x elements, d speed / d impulse. `guess`: torques to start from (the last step's).
  /// The result is good until the next call; no allocation once sizes are known.
  const DrySolution& solve(const std::vector<DryElement>& elements,
                           const Eigen::MatrixXd& compliance, const Eigen::VectorXd& free_speed,
                           double step_s, const Eigen::VectorXd& guess);

 private:
  DrySolution solution_;
};

}  // namespace kinescope
