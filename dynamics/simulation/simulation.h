// SPDX-License-Identifier: Apache-2.0
//
// Forward dynamics of a Plant and its motion in time.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "dynamics/rigid/momentum.h"
#include "dynamics/rigid/newton_euler.h"
#include "dynamics/simulation/dry_friction.h"
#include "dynamics/simulation/plant.h"

namespace kinescope {

struct PlantState {
  double t_s = 0.0;
  Eigen::VectorXd q;                            ///< rad or m
  Eigen::VectorXd dq;                           ///< per s
  Eigen::VectorXd ddq;                          ///< mean over the last step; zero at first
  std::vector<std::vector<double>> presliding;  ///< Dahl's states of every joint, between -1 and 1

  /// At rest or moving, pre-sliding as after a long way in the direction of each speed.
  [[nodiscard]] static PlantState at(const Plant& plant, Eigen::VectorXd q, Eigen::VectorXd dq,
                                     double t_s = 0.0);
};

/// Moves a plant in fixed steps. Bodies and smooth torques by the midpoint of the step (order 2),
/// viscous friction by the trapezoidal rule, dry friction implicit (dry_friction.h): Moreau and
/// Jean's scheme, Acary and Brogliato 2008, section 10.1. A joint that its friction can hold stays
/// exactly where it is; a joint that slides turns by the traced law. Load friction takes the load
/// of the step before. No allocation after the first step.
class Simulation {
 public:
  Simulation(Plant plant, PlantState state);

  [[nodiscard]] const Plant& plant() const { return plant_; }
  [[nodiscard]] const PlantState& state() const { return state_; }
  void set_state(PlantState state);

  /// `torque`: true torques of the actuators, held over the step. Throws undetermined where the
  /// mass matrix is not positive definite, or the motion is no longer finite.
  const PlantState& step(const Eigen::VectorXd& torque, double step_s);

  /// ddq under true torques at the present state, M^-1 (torque - C dq - g - drives); joints at rest
  /// are held by friction that sticks as long as it can. Throws as step().
  [[nodiscard]] Eigen::VectorXd acceleration(const Eigen::VectorXd& torque);

 private:
  void evaluate(double t_s);
  void make_right_side(const Eigen::VectorXd& torque, double step_s);
  void make_elements();
  void factorise();
  void add_friction(double step_s);
  void move_presliding(double step_s);

  Plant plant_;
  PlantState state_;
  MomentumRecursion momentum_;
  rigid::NewtonEuler newton_euler_;
  rigid::NewtonEuler load_newton_euler_;
  bool has_load_ = false;
  Eigen::MatrixXd rows_;  ///< elements x joints: whose speeds the friction elements see
  std::vector<DryElement> elements_;
  DryFrictionSolver solver_;

  // Of the step.
  Eigen::VectorXd zero_, q_mid_, dq_mid_, bias_, load_, right_, speed_, friction_, free_;
  Eigen::MatrixXd mass_, compliance_, solved_rows_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

}  // namespace kinescope
