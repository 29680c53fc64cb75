// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "dynamics/effects/torque_parts.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope::effects {
namespace {

/// Combinations of the bodies' parameters that the log shows, each of unit effect on the whitened
/// torque: 10 bodies x base parameters.
Eigen::MatrixXd shown_bodies(const std::vector<Eigen::MatrixXd>& Y, const Eigen::VectorXd& sigma) {
  const Eigen::Index n = Y.front().cols();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t j = 0; j < Y.size(); ++j) {
    H.noalias() += Y[j].transpose() * Y[j] / std::pow(sigma[static_cast<Eigen::Index>(j)], 2);
  }
  const Eigen::VectorXd scale = unit_scale(H);
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * H * scale.asDiagonal());
  const Eigen::VectorXd& values = eigen.values;
  Eigen::Index first = 0;
  while (first < n && !(values[first] > kUnobservable * values[n - 1])) ++first;
  return scale.asDiagonal() * eigen.vectors.rightCols(n - first) *
         values.tail(n - first).cwiseSqrt().cwiseInverse().asDiagonal();
}

}  // namespace

void GravityCase::set_carriers(const Eigen::SparseMatrix<double>& all) {
  carriers = all;
  const Eigen::Index joints = fixed.cols();
  carrier_torques.assign(static_cast<std::size_t>(carriers.cols()),
                         JointTorques(static_cast<std::size_t>(joints)));
  for (int c = 0; c < carriers.outerSize(); ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator entry(carriers, c); entry; ++entry) {
      Eigen::VectorXd& torque = carrier_torques[static_cast<std::size_t>(c)]
                                               [static_cast<std::size_t>(entry.row() % joints)];
      if (torque.size() == 0) torque.setZero(fixed.rows());
      torque[entry.row() / joints] = entry.value();
    }
  }
}

std::shared_ptr<const GravityCase> make_gravity_case(const TorqueTracedModel::Parts& parts,
                                                     const Eigen::Vector2d& tilt_deg) {
  auto out = std::make_shared<GravityCase>();
  out->tilt_deg = tilt_deg;
  out->rigid = parts.base.rigid;
  out->rigid.gravity_m_s2 = tilted(parts.base.rigid.gravity_m_s2, tilt_deg);
  out->context = parts.context;
  out->context.rigid.gravity_m_s2 = out->rigid.gravity_m_s2;
  out->context.gravity_moves = tilt_moves(out->rigid.gravity_m_s2);
  if (!tilt_deg.isZero(0.0)) {
    out->context.load =
        inverse_dynamics_of_samples(out->context.rigid, parts.q, parts.dq, parts.ddq);
  }
  const Eigen::Index joints = parts.q.cols();
  const bool declared = parts.base.kind == TorqueBaseKind::kDeclared;
  out->fixed = Eigen::MatrixXd::Zero(parts.q.rows(), joints);
  if (declared) {
    out->fixed = inverse_dynamics_of_samples(out->rigid, parts.q, parts.dq, parts.ddq) +
                 parts.dq * parts.viscous.asDiagonal();
    out->base.assign(static_cast<std::size_t>(joints), Eigen::MatrixXd(parts.q.rows(), 0));
  } else {
    const std::vector<Eigen::MatrixXd> Y =
        regressors_of_samples(out->rigid, parts.q, parts.dq, parts.ddq);
    out->bodies = shown_bodies(Y, parts.base.sigma);
    for (const Eigen::MatrixXd& joint : Y) out->base.emplace_back(joint * out->bodies);
  }
  for (const Eigen::MatrixXd& base : out->base) {
    out->base_squares.emplace_back(base.transpose() * base);
  }
  out->set_carriers(make_carriers(out->context));
  return out;
}

}  // namespace kinescope::effects
