// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/cost.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

struct Residual {
  double value;
  double slope;
};

Residual residual(const CostTerm& term, double x) {
  const double e = x - term.target;
  switch (term.error) {
    case CostError::kDifference:
      return {e, 1.0};
    case CostError::kAbsolute:
      return {std::abs(x) - term.target, x < 0.0 ? -1.0 : 1.0};
    case CostError::kCircular:
      return {2.0 * std::sin(0.5 * e), std::cos(0.5 * e)};
  }
  KINESCOPE_CHECK(false, "an error of a cost that is not known");
}

}  // namespace

void check_cost(const SaturatingCost& cost, const StateLayout& layout) {
  if (cost.terms.empty()) {
    throw bad_request("cost", "it has no term", "name a position with target and length scale");
  }
  for (const CostTerm& term : cost.terms) {
    if (term.state < 0 || term.state >= layout.state_count()) {
      throw bad_request("cost", fmt::format("state {} is not there", term.state),
                        fmt::format("give 0 to {}", layout.state_count() - 1));
    }
    if (!(term.length_scale > 0.0) || !std::isfinite(term.length_scale) ||
        !std::isfinite(term.target)) {
      throw bad_request(
          "cost", fmt::format("target {} with length scale {}", term.target, term.length_scale),
          "give finite numbers, the length scale above 0");
    }
    const bool angle = term.state < layout.position_count() &&
                       layout.is_angle[static_cast<std::size_t>(term.state)];
    if (term.error == CostError::kCircular && !angle) {
      throw bad_request("cost", fmt::format("state {} is no angle", term.state),
                        "ask for its difference from the target");
    }
  }
}

Eigen::VectorXd state_cost(const SaturatingCost& cost, const ConstBlock& states) {
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(states.rows());
  for (const CostTerm& term : cost.terms) {
    for (Index i = 0; i < states.rows(); ++i) {
      const double z = residual(term, states(i, term.state)).value / term.length_scale;
      squares[i] += z * z;
    }
  }
  return 1.0 - (-squares.array()).exp();
}

void state_cost_pullback(const SaturatingCost& cost, const ConstBlock& states,
                         const Eigen::Ref<const Eigen::VectorXd>& costs,
                         const Eigen::Ref<const Eigen::VectorXd>& d_costs, Block d_states) {
  for (const CostTerm& term : cost.terms) {
    const double scale = 2.0 / (term.length_scale * term.length_scale);
    for (Index i = 0; i < states.rows(); ++i) {
      const Residual r = residual(term, states(i, term.state));
      d_states(i, term.state) += d_costs[i] * (1.0 - costs[i]) * scale * r.value * r.slope;
    }
  }
}

}  // namespace kinescope::policy
