// SPDX-License-Identifier: Apache-2.0
//
// The saturating cost of a state: 1 - exp(-sum_t (e_t / length_scale_t)^2) in [0, 1) (Amadio et
// al., T-RO 2022), summed over time by the learner.
#pragma once

#include <vector>

#include "dynamics/policy/state_features.h"

namespace kinescope::policy {

/// How far a position is from where it should be.
enum class CostError {
  kDifference,  ///< x - target
  kAbsolute,    ///< |x| - target: an angle that may come from either side
  kCircular,    ///< 2 sin((x - target) / 2): an angle, whatever its turns
};

struct CostTerm {
  Eigen::Index state = 0;     ///< index into (p, dp)
  double target = 0.0;        ///< unit of the state
  double length_scale = 1.0;  ///< unit of the state; the cost is 0.63 where it is off by so much
  CostError error = CostError::kDifference;
  bool operator==(const CostTerm&) const = default;
};

struct SaturatingCost {
  std::vector<CostTerm> terms;
  bool operator==(const SaturatingCost&) const = default;
};

/// Throws bad_request for a cost without terms, a state that is not there, a length scale that is
/// not above zero, a circular error of what is no angle.
void check_cost(const SaturatingCost& cost, const StateLayout& layout);

/// Cost (rows) of states (rows x 2 P).
[[nodiscard]] Eigen::VectorXd state_cost(const SaturatingCost& cost, const ConstBlock& states);
/// d_states += d_cost * d cost / d state, row by row.
void state_cost_pullback(const SaturatingCost& cost, const ConstBlock& states,
                         const Eigen::Ref<const Eigen::VectorXd>& costs,
                         const Eigen::Ref<const Eigen::VectorXd>& d_costs, Block d_states);

}  // namespace kinescope::policy
