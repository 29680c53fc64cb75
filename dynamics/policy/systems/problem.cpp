// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/problem.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

double error_of(const CostTerm& term, double value) {
  switch (term.error) {
    case CostError::kAbsolute:
      return std::abs(std::abs(value) - term.target);
    case CostError::kCircular:
      // The angle itself, where the cost has its chord.
      return 2.0 * std::asin(std::abs(std::sin(0.5 * (value - term.target))));
    case CostError::kDifference:
      break;
  }
  return std::abs(value - term.target);
}

}  // namespace

void check_problem(const PolicyProblem& problem) {
  check_learner(*problem.system, problem.task, problem.learner);
  const StateLayout& layout = problem.system->layout();
  KINESCOPE_CHECK(problem.tolerance.size() == layout.position_count(), "a tolerance a position");
  if (!(problem.tolerance.array() > 0.0).all()) {
    throw bad_request("tolerance", "is not above zero", "give a positive one, or none");
  }
}

double position_error(const SaturatingCost& cost, Eigen::Index position, double value) {
  const auto term = std::ranges::find(cost.terms, position, &CostTerm::state);
  return term == cost.terms.end() ? 0.0 : error_of(*term, value);
}

bool succeeded(const PolicyProblem& problem, const Trial& trial) {
  if (!problem.tolerance.array().isFinite().any()) return false;
  const Eigen::MatrixXd& states = trial.truth.size() > 0 ? trial.truth : trial.smoothed;
  const StateLayout& layout = problem.system->layout();
  const auto last_second = static_cast<Eigen::Index>(std::lround(1.0 / layout.step_s));
  for (Eigen::Index k = std::max<Eigen::Index>(0, states.rows() - 1 - last_second);
       k < states.rows(); ++k) {
    for (Eigen::Index p = 0; p < layout.position_count(); ++p) {
      const double error = position_error(problem.task.cost, p, states(k, p));
      if (!(error <= problem.tolerance[p])) return false;
    }
  }
  return true;
}

}  // namespace kinescope::policy
