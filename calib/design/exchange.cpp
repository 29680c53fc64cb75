// SPDX-License-Identifier: Apache-2.0
#include "calib/design/exchange.h"

#include <algorithm>

#include "kinematics/core/error.h"
#include "kinematics/core/parallel_for.h"

namespace kinescope::design {
namespace {

// Passes over the chosen ones; the second seldom finds anything (experiment plan_promises).
constexpr int kMostPasses = 2;
// A candidate takes another's place where the criterion falls by more than rounding.
constexpr double kBetter = 1e-9;

struct Best {
  std::size_t candidate = 0;
  double criterion = 0.0;
};

Best best_beside(const DesignProblem& problem, const Eigen::MatrixXd& information) {
  std::vector<double> values(problem.candidates.size());
  parallel_for(values.size(), [&](std::size_t i) {
    values[i] = problem.criterion(information + problem.candidates[i]);
  });
  const auto least = std::ranges::min_element(values);
  return {static_cast<std::size_t>(least - values.begin()), *least};
}

}  // namespace

std::vector<std::size_t> choose_candidates(const DesignProblem& problem, std::size_t count,
                                           const std::vector<std::size_t>& held) {
  KINESCOPE_CHECK(!problem.candidates.empty(), "something to choose from");
  Eigen::MatrixXd information = problem.known;
  std::vector<std::size_t> chosen = held;
  for (const std::size_t i : held) information += problem.candidates[i];
  double now = problem.criterion(information);
  while (chosen.size() < held.size() + count) {
    const Best best = best_beside(problem, information);
    chosen.push_back(best.candidate);
    information += problem.candidates[best.candidate];
    now = best.criterion;
  }
  for (int pass = 0; pass < kMostPasses; ++pass) {
    bool exchanged = false;
    for (std::size_t k = held.size(); k < chosen.size(); ++k) {
      const Eigen::MatrixXd without = information - problem.candidates[chosen[k]];
      const Best best = best_beside(problem, without);
      const double least_gain = std::isfinite(now) ? kBetter * std::abs(now) : 0.0;
      if (!(best.criterion < now - least_gain)) continue;
      chosen[k] = best.candidate;
      information = without + problem.candidates[best.candidate];
      now = best.criterion;
      exchanged = true;
    }
    if (!exchanged) break;
  }
  return {chosen.begin() + static_cast<std::ptrdiff_t>(held.size()), chosen.end()};
}

}  // namespace kinescope::design
