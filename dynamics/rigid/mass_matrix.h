// SPDX-License-Identifier: Apache-2.0
//
// Mass matrix, Coriolis matrix, forward dynamics, energies.
#pragma once

#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

/// M(q), joints x joints, kg m^2 (kg m, kg where joints slide), motor inertias on the diagonal.
/// Composite rigid bodies, Featherstone 2008, section 6.3.
[[nodiscard]] Eigen::MatrixXd mass_matrix(const RigidModel& model, const Eigen::VectorXd& q);

/// The weight of all that a joint moves, at its radius of gyration about the axis (a sliding joint:
/// the weight), N m or N, one a joint: the order of what its drive is built for, wherever gravity
/// pulls.
[[nodiscard]] Eigen::VectorXd weight_scale(const RigidModel& model, const Eigen::VectorXd& q);

/// C(q, dq) of the Christoffel symbols: dM/dt - 2C is skew-symmetric. Echeandia and Wensing 2021,
/// algorithm 1, in the base frame.
[[nodiscard]] Eigen::MatrixXd coriolis_matrix(const RigidModel& model, const Eigen::VectorXd& q,
                                              const Eigen::VectorXd& dq);

/// ddq under a torque: M^-1 (torque - C dq - g). By LDL' of M, O(joints^3) with a small constant.
/// Throws bad_request where M is not positive definite (a joint that moves no mass).
[[nodiscard]] Eigen::VectorXd forward_dynamics(const RigidModel& model, const Eigen::VectorXd& q,
                                               const Eigen::VectorXd& dq,
                                               const Eigen::VectorXd& torque);

/// dq' M(q) dq / 2, J.
[[nodiscard]] double kinetic_energy(const RigidModel& model, const Eigen::VectorXd& q,
                                    const Eigen::VectorXd& dq);
/// Of the moving bodies in the gravity field, J; zero for mass at the base frame's origin.
[[nodiscard]] double potential_energy(const RigidModel& model, const Eigen::VectorXd& q);

}  // namespace kinescope
