// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/normal_equations.h"

#include "kinematics/core/dense_algebra.h"

namespace kinescope::trace {

NormalEquations& NormalEquations::operator+=(const NormalEquations& other) {
  H += other.H;
  g += other.g;
  return *this;
}

std::vector<NormalEquations> augmented(const std::vector<GroupSums>& own,
                                       const std::vector<EffectSums>& effect) {
  std::vector<NormalEquations> out;
  for (std::size_t k = 0; k < own.size(); ++k) {
    if (effect.empty()) {
      out.push_back({own[k].H, own[k].g});
      continue;
    }
    const Eigen::Index n = own[k].g.size() + effect[k].Er.size();
    NormalEquations group{Eigen::MatrixXd(n, n), Eigen::VectorXd(n)};
    group.H << own[k].H, effect[k].JE, effect[k].JE.transpose(), effect[k].EE;
    group.g << own[k].g, effect[k].Er;
    out.push_back(std::move(group));
  }
  return out;
}

NormalEquations total_of(const NormalSystem& system, const std::vector<NormalEquations>& groups) {
  NormalEquations total = groups.front();
  for (std::size_t k = 1; k < groups.size(); ++k) total += groups[k];
  const Eigen::MatrixXd& prior = system.linear().prior;
  if (prior.size() > 0) total.H.topLeftCorner(prior.rows(), prior.cols()) += prior;
  const Eigen::VectorXd& pull = system.linear().prior_gradient;
  if (pull.size() > 0) total.g.head(pull.size()) -= pull;
  return total;
}

Eigen::VectorXd solve_without(const NormalEquations& total, const NormalEquations& part) {
  // Where one part alone shows a parameter, this keeps that parameter where it is.
  constexpr double kRidge = 1e-11;
  const Eigen::VectorXd scale = unit_scale(total.H);
  Eigen::MatrixXd H = scale.asDiagonal() * (total.H - part.H) * scale.asDiagonal();
  H.diagonal().array() += kRidge;
  const Eigen::VectorXd g = scale.asDiagonal() * (total.g - part.g);
  // The ridge makes it positive definite, but for rounding where parts show nothing.
  const CholeskyFactor factor(H);
  return scale.asDiagonal() *
         (factor.positive_definite() ? factor.solve(g) : solve_symmetric(H, g));
}

}  // namespace kinescope::trace
