// SPDX-License-Identifier: Apache-2.0
//
// The policy: a weighted sum of Gaussian basis functions of the seen state, squashed below the
// inputs' limits (Amadio et al., T-RO 2022; Deisenroth, Fox and Rasmussen 2015).
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "dynamics/policy/system.h"

namespace kinescope::policy {

/// u_k = limit_k tanh(a_k / limit_k), a_k = sum_b weights(b, k) exp(-1/2 sum_f ((z_f - centres(b,
/// f)) / length_scales_f)^2), with z = state_features() of the seen state.
struct RbfPolicy {
  Eigen::MatrixXd centres;        ///< B x F, units of the features
  Eigen::VectorXd length_scales;  ///< F, common to all basis functions
  Eigen::MatrixXd weights;        ///< B x U, units of the inputs
  Eigen::VectorXd input_limit;    ///< U

  [[nodiscard]] Eigen::Index basis_count() const { return centres.rows(); }
  [[nodiscard]] Eigen::Index input_count() const { return weights.cols(); }
  friend bool operator==(const RbfPolicy& a, const RbfPolicy& b) {
    return a.centres == b.centres && a.length_scales == b.length_scales && a.weights == b.weights &&
           a.input_limit == b.input_limit;
  }
};

/// What a new policy is drawn from.
struct PolicyOptions {
  int basis_count = 200;
  /// Standard deviation of the first weights, relative to the input's limit.
  double weight_sigma = 0.3;
  /// Centres of positions that are no angles and of speeds are uniform in +- so many standard
  /// deviations of what the trials show; of angles, uniform on the circle.
  double centre_range = 2.5;
};

/// `states`: rows x 2 P, what the centres are to cover (the trials so far). The same seed, the same
/// policy.
[[nodiscard]] RbfPolicy draw_policy(const StateLayout& layout, const PolicyOptions& options,
                                    const Eigen::MatrixXd& states, std::uint64_t seed);

/// Throws bad_request where the policy's sizes are not those of the layout, a length scale is not
/// above zero or a number is not finite.
void check_policy(const RbfPolicy& policy, const StateLayout& layout);

/// The input (U) at a seen state (2 P).
[[nodiscard]] Eigen::VectorXd policy_input(const RbfPolicy& policy, const StateLayout& layout,
                                           const Eigen::VectorXd& seen);
/// The same as what a System runs.
[[nodiscard]] Controller controller_of(RbfPolicy policy, StateLayout layout);

}  // namespace kinescope::policy
