// SPDX-License-Identifier: Apache-2.0
//
// The regressor of a log is linear in gravity: the motion is evaluated once for every direction in
// which gravity may pull. Internal to this room.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "dynamics/rigid/rigid_model.h"

namespace kinescope::effects {

/// Made of one model's geometry; masses come later. Matrices are one a joint.
struct GravityRegressors {
  Eigen::Vector3d declared_m_s2 = Eigen::Vector3d::Zero();
  std::vector<Eigen::MatrixXd> declared;  ///< in that gravity, instants x 10 bodies
  /// What 1 m/s^2 along each axis of the base adds to the columns of the masses and the first
  /// moments, all that gravity acts on: instants x 4 bodies.
  std::array<std::vector<Eigen::MatrixXd>, 3> along;
  /// Products over the instants: of the declared ones, with those along each axis, and of these
  /// with one another (axes 00, 10, 11, 20, 21, 22).
  std::vector<Eigen::MatrixXd> squares;
  std::array<std::vector<Eigen::MatrixXd>, 3> mixed;
  std::array<std::vector<Eigen::MatrixXd>, 6> along_squares;

  /// Y of a joint, instants x 10 bodies.
  [[nodiscard]] Eigen::MatrixXd regressor(std::size_t joint,
                                          const Eigen::Vector3d& gravity_m_s2) const;
  /// Y' Y of a joint, without the instants.
  [[nodiscard]] Eigen::MatrixXd normal(std::size_t joint,
                                       const Eigen::Vector3d& gravity_m_s2) const;
  /// d torque / d gravity of bodies of this geometry, along each axis: instants x joints.
  [[nodiscard]] std::array<Eigen::MatrixXd, 3> slopes(const RigidModel& model) const;
};

/// Rates and accelerations of the same instants, instants x joints. Costs four regressors of the
/// log and their products.
[[nodiscard]] GravityRegressors make_gravity_regressors(const RigidModel& model,
                                                        const Eigen::MatrixXd& q,
                                                        const Eigen::MatrixXd& dq,
                                                        const Eigen::MatrixXd& ddq);

}  // namespace kinescope::effects
