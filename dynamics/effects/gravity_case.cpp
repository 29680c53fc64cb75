// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <Eigen/Eigenvalues>

#include "dynamics/effects/torque_parts.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"

namespace kinescope::effects {
namespace {

constexpr double kUnseen = 1e-10;  // base parameters: share of the largest direction's square

/// Combinations of the bodies' parameters that the log shows, each of unit effect on the whitened
/// torque: 10 bodies x base parameters.
Eigen::MatrixXd shown_bodies(const std::vector<Eigen::MatrixXd>& Y, const Eigen::VectorXd& sigma) {
  const Eigen::Index n = Y.front().cols();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t j = 0; j < Y.size(); ++j) {
    H.noalias() += Y[j].transpose() * Y[j] / std::pow(sigma[static_cast<Eigen::Index>(j)], 2);
  }
  const Eigen::VectorXd diagonal = H.diagonal();
  const Eigen::VectorXd scale =
      (diagonal.array() > 0.0).select(diagonal.cwiseMax(1e-300).cwiseSqrt().cwiseInverse(), 0.0);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * H *
                                                             scale.asDiagonal());
  const Eigen::VectorXd& values = eigen.eigenvalues();
  Eigen::Index first = 0;
  while (first < n && !(values[first] > kUnseen * values[n - 1])) ++first;
  return scale.asDiagonal() * eigen.eigenvectors().rightCols(n - first) *
         values.tail(n - first).cwiseSqrt().cwiseInverse().asDiagonal();
}

}  // namespace

std::shared_ptr<const GravityCase> make_gravity_case(const TorqueTracedModel::Parts& parts,
                                                     const Eigen::Vector2d& tilt_deg) {
  auto out = std::make_shared<GravityCase>();
  out->tilt_deg = tilt_deg;
  out->rigid = parts.base.rigid;
  out->rigid.gravity_m_s2 = tilted(parts.base.rigid.gravity_m_s2, tilt_deg);
  out->context = parts.context;
  out->context.rigid.gravity_m_s2 = out->rigid.gravity_m_s2;
  out->context.gravity_moves = tilt_moves(parts.base.rigid.gravity_m_s2, tilt_deg);
  if (!tilt_deg.isZero(0.0)) {
    out->context.load =
        inverse_dynamics_of_samples(out->context.rigid, parts.q, parts.dq, parts.ddq);
  }
  out->carriers = make_carriers(out->context);
  const Eigen::Index joints = parts.q.cols();
  const Eigen::Index rows = parts.q.rows() * joints;
  if (parts.base.kind == TorqueBaseKind::kDeclared) {
    const Eigen::MatrixXd torque =
        inverse_dynamics_of_samples(out->rigid, parts.q, parts.dq, parts.ddq) +
        parts.dq * parts.viscous.asDiagonal();
    out->fixed = torque.transpose().reshaped();
    out->base.resize(rows, 0);
    return out;
  }
  out->fixed = Eigen::VectorXd::Zero(rows);
  const std::vector<Eigen::MatrixXd> Y =
      regressors_of_samples(out->rigid, parts.q, parts.dq, parts.ddq);
  out->bodies = shown_bodies(Y, parts.base.sigma);
  out->base.resize(rows, out->bodies.cols());
  for (Eigen::Index j = 0; j < joints; ++j) {
    out->base(Eigen::seqN(j, parts.q.rows(), joints), Eigen::all) =
        Y[static_cast<std::size_t>(j)] * out->bodies;
  }
  return out;
}

}  // namespace kinescope::effects
