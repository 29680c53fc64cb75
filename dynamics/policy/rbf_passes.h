// SPDX-License-Identifier: Apache-2.0
//
// The policy of a block of particles and its pullback: one pass over basis functions and particles
// each, internal. Rows are particles, a multiple of eight.
#pragma once

#include "dynamics/policy/rbf_policy.h"
#include "dynamics/policy/state_features.h"

namespace kinescope::policy {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Basis functions are taken in pairs: the last of an odd number gets one of weight zero.
[[nodiscard]] constexpr Eigen::Index even(Eigen::Index basis_count) {
  return basis_count + basis_count % 2;
}

/// The policy's numbers as the passes read them; once a step of the search.
struct PreparedPolicy {
  explicit PreparedPolicy(const RbfPolicy& policy);
  RowMajor scaled_centres;       ///< even(B) x F, over the length scales
  Eigen::VectorXd half_squares;  ///< even(B): -1/2 |scaled centre|^2
  RowMajor weights;              ///< even(B) x U
  Eigen::RowVectorXd inverse_scales;
  Eigen::RowVectorXd limits;
};

/// Gradient by the policy's numbers, length scales by their logarithm.
struct PolicyGradient {
  Eigen::Index basis_count;
  RowMajor centres;  ///< even(B) x F
  RowMajor weights;  ///< even(B) x U
  Eigen::RowVectorXd log_scales;
  Eigen::VectorXd totals;  ///< workspace

  explicit PolicyGradient(const RbfPolicy& policy);
  void set_zero();
  void add(const PolicyGradient& other);
  [[nodiscard]] double norm() const;
};

/// `scaled` = features over the length scales (rows x F). `basis` (rows x even(B)) comes as
/// dropout's factors and leaves as basis functions times those; inputs (rows x U) = squashed sums.
void policy_value(const PreparedPolicy& policy, const ConstBlock& scaled, Block basis,
                  Block inputs);
/// From d_inputs, which is overwritten: d_scaled = pullback to the scaled features; adds to the
/// gradient, there by the scaled centres (`finish_gradient` turns them into centres).
void policy_pullback(const PreparedPolicy& policy, const ConstBlock& scaled,
                     const ConstBlock& basis, const ConstBlock& inputs, Block d_inputs,
                     Block d_scaled, PolicyGradient& gradient);
void finish_gradient(const PreparedPolicy& policy, PolicyGradient& gradient);

/// By parameters_of(policy).
[[nodiscard]] Eigen::VectorXd search_gradient(const PolicyGradient& gradient,
                                              const RbfPolicy& policy);

}  // namespace kinescope::policy
