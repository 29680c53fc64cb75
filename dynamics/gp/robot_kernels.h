// SPDX-License-Identifier: Apache-2.0
//
// Kernels for inverse dynamics. They know of the robot only which joints turn and which slide.
// Inputs are samples x 3n: q (rad or m), dq, ddq, in the order of the joints, not normalised.
#pragma once

#include "dynamics/gp/kernel.h"

namespace kinescope::gp {

enum class JointKind { kRevolute, kPrismatic };
using JointKinds = std::vector<JointKind>;

/// (cos q_j, sin q_j) of a revolute, q_j of a prismatic joint.
[[nodiscard]] FeatureMap joint_position(const JointKinds& joints, int joint);
/// (ddq_i), (dq_i dq_j with i <= j): what a rigid body's torque is linear in beside gravity.
[[nodiscard]] FeatureMap accelerations_and_velocity_products(int joints);

/// For every joint the product of two linear kernels of its position with offset 1; their weights
/// start at `first` and `second` over the joint's mean square.
[[nodiscard]] Kernel position_factors(const JointKinds& joints, double first, double second,
                                      const std::vector<double>& mean_squares);

/// Geometrically inspired polynomial kernel (Dalla Libera and Carli 2020, arXiv 1904.13317,
/// section IV) of one joint's torque: a linear kernel with offset in the accelerations and velocity
/// products, times, for every joint, a multiplicative polynomial of degree 2 in its position. Each
/// factor has its own weights; the common scale is in the first.
[[nodiscard]] Kernel gip(const JointKinds& joints);
/// The same kernel with a start for normalised targets: over these inputs the prior variance is
/// about 1, and weight against offset are those of a point mass at one metre under gravity. From
/// weights of 1 the variance grows with every joint, and a search can end far off.
[[nodiscard]] Kernel gip(const JointKinds& joints, const Inputs& inputs);

/// Linear kernel of viscous and Coulomb friction of one joint.
[[nodiscard]] Kernel joint_friction(int joints, int joint, double transition_velocity = 0.0);

/// The semi-parametric kernel: features of a model with the covariance of their weights, plus a
/// squared exponential of the columns for what the model lacks.
[[nodiscard]] Kernel semi_parametric(FeatureMap model, const Eigen::MatrixXd& sigma,
                                     FeatureMap rest);

}  // namespace kinescope::gp
