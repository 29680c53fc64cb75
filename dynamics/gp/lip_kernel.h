// SPDX-License-Identifier: Apache-2.0
//
// Takes   inputs samples x 3n (q in rad or m, dq, ddq), which joints turn and which slide.
// Gives   a kernel of all n torques together that obeys the Euler-Lagrange equations.
// Method  Lagrangian-inspired polynomial kernel (Giacomuzzo, Carli, Romeres and Dalla Libera 2024,
//         arXiv 2310.06585): Gaussian-process priors on kinetic and potential energy,
//           k_T = sum_i (sum_{b<=i} w_ib dq_b dq'_b)^2 prod_{j<=i} (1 + c_ij . p_j p'_j)^2,
//           k_V = v prod_j (1 + c_j . p_j p'_j),   p_j = (cos q_j, sin q_j), or q_j if it slides,
//         and torque_a = d/dt dL/d(dq_a) - dL/dq_a on both arguments, L = T - V.
// Not here: friction: add independent_outputs({joint_friction(n, 0), ..}).
#pragma once

#include "dynamics/gp/robot_kernels.h"

namespace kinescope::gp {

[[nodiscard]] Kernel lip(const JointKinds& joints);

/// Largest number of joints; inner loops keep a pair's quantities on the stack.
inline constexpr int kLipMaxJoints = 10;

}  // namespace kinescope::gp
