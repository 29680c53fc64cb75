// SPDX-License-Identifier: Apache-2.0
//
// From motion to torque. Motor inertias are part of the model (they add to the diagonal of the mass
// matrix); friction is not.
#pragma once

#include <array>

#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

/// Torque that moves the robot so: M(q) ddq + C(q, dq) dq + g(q). Featherstone 2008, table 5.1.
/// O(bodies). All functions throw std::logic_error where sizes differ.
[[nodiscard]] Eigen::VectorXd inverse_dynamics(const RigidModel& model, const Eigen::VectorXd& q,
                                               const Eigen::VectorXd& dq,
                                               const Eigen::VectorXd& ddq);

/// A whole log at once: samples x joints in, samples x joints out.
[[nodiscard]] Eigen::MatrixXd inverse_dynamics_of_samples(const RigidModel& model,
                                                          const Eigen::MatrixXd& q,
                                                          const Eigen::MatrixXd& dq,
                                                          const Eigen::MatrixXd& ddq);

/// Torque that holds the robot still, g(q).
[[nodiscard]] Eigen::VectorXd gravity_torque(const RigidModel& model, const Eigen::VectorXd& q);

/// d torque / d gravity, joints x 3, per m/s^2 in the base frame. Torque is linear in gravity: this
/// times the gravity vector is gravity_torque(), and the rest of the torque does not depend on it.
[[nodiscard]] Eigen::Matrix<double, Eigen::Dynamic, 3> gravity_jacobian(const RigidModel& model,
                                                                        const Eigen::VectorXd& q);
/// The same of a whole log: one matrix an axis of the base, samples x joints.
[[nodiscard]] std::array<Eigen::MatrixXd, 3> gravity_slopes_of_samples(const RigidModel& model,
                                                                       const Eigen::MatrixXd& q);

/// C(q, dq) dq: centrifugal and Coriolis torque.
[[nodiscard]] Eigen::VectorXd coriolis_torque(const RigidModel& model, const Eigen::VectorXd& q,
                                              const Eigen::VectorXd& dq);

}  // namespace kinescope
