// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/normal_equations.h"

#include "kinematics/core/dense_algebra.h"

namespace kinescope::trace {

NormalEquations& NormalEquations::operator+=(const NormalEquations& other) {
  H += other.H;
  g += other.g;
  return *this;
}

NormalEquations zero_like(const NormalEquations& other) {
  return {Eigen::MatrixXd::Zero(other.H.rows(), other.H.cols()),
          Eigen::VectorXd::Zero(other.g.size())};
}

std::vector<NormalEquations> augmented_cells(const NormalSystem& system,
                                             const std::vector<EffectSums>& effect) {
  std::vector<NormalEquations> out;
  for (std::size_t c = 0; c < system.cells().size(); ++c) {
    const CellSums& own = system.cells()[c];
    if (effect.empty()) {
      out.push_back({own.H, own.g});
      continue;
    }
    const Eigen::Index n = own.g.size() + effect[c].Er.size();
    NormalEquations cell{Eigen::MatrixXd(n, n), Eigen::VectorXd(n)};
    cell.H << own.H, effect[c].JE, effect[c].JE.transpose(), effect[c].EE;
    cell.g << own.g, effect[c].Er;
    out.push_back(std::move(cell));
  }
  return out;
}

NormalEquations total_of(const NormalSystem& system, const std::vector<NormalEquations>& cells) {
  NormalEquations total = zero_like(cells.front());
  for (const NormalEquations& cell : cells) total += cell;
  const Eigen::MatrixXd& prior = system.linear().prior;
  if (prior.size() > 0) total.H.topLeftCorner(prior.rows(), prior.cols()) += prior;
  const Eigen::VectorXd& pull = system.linear().prior_gradient;
  if (pull.size() > 0) total.g.head(pull.size()) -= pull;
  return total;
}

Eigen::VectorXd solve_without(const NormalEquations& total, const NormalEquations& part) {
  // Where one part alone shows a parameter, this keeps that parameter where it is.
  constexpr double kRidge = 1e-11;
  const Eigen::VectorXd scale = total.H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd H = scale.asDiagonal() * (total.H - part.H) * scale.asDiagonal();
  H.diagonal().array() += kRidge;
  const Eigen::VectorXd g = scale.asDiagonal() * (total.g - part.g);
  return scale.asDiagonal() * solve_symmetric(H, g);
}

}  // namespace kinescope::trace
